"""Beyond the paper: our own method (refinement), explanations, comparisons with other methods, and benchmarks."""
