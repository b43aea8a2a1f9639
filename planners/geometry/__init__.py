"""Lines, curves and swept footprints among blocked cells; no maps."""
