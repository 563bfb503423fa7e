"""`ema bench`: speed and accuracy of the fidelities in one table, the master's overhead, and peers."""
