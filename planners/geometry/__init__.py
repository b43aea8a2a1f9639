"""Lines, curves and swept footprints among blocked cells, without a map."""
