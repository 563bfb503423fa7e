"""`ema bench`: speed and accuracy of the fidelities, overhead of the master, peers; and identification put to the test."""
