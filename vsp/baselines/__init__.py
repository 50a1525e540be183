"""Baselines to compare with a Voronoi partition: a linear map, k-means cells, trees, DAgger, TD-AVQ."""

from .simple import kmeans_cells, linear_map, refit, rule_of_thumb
from .trees import LinearTree, ObliqueLinearTree, Tree
