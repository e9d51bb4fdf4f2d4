"""From a mask to the lines in its middle, in numpy: `compiled` must give the same, faster."""

from .pixels import small_mask, straight_on, without_small
from .thinning import thin
from .tracing import trace

__all__ = ["small_mask", "straight_on", "thin", "trace", "without_small"]
