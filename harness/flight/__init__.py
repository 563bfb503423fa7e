"""FMUs in flight: opened, then driven through trials alone, one after another, or coupled."""
