"""FMUs in flight: files opened, instances driven through trials, alone, one after another, or coupled."""
