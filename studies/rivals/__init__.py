"""Methods to compare our cells with: trees, small networks, DAgger."""
