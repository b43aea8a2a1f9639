"""The fuzzer behind ``make fuzz``: damaged files for every reader, odd values for the API."""
