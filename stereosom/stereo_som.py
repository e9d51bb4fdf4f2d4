"""The paper's Algorithm 1: a self-organizing map trained in two views at once.

Sections II-B and II-C of J. M. Croom, D. C. Rucker, J. M. Romano, R. J. Webster III, "Visual
sensing of continuum robot shape using self-organizing maps", IEEE ICRA 2010.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .assessment import assess
from .backbone import Backbone
from .camera import StereoRig, triangulate
from .ends import find_ends, trim_to_shared_stretch
from .observation import Observation
from .options import Options, check_whole
from .reconstruction import HardFrame, Reconstruction
from .som import Trainer, adjacency_matrix, best_two_units, order_by_adjacency

METHOD = "stereo-som"

TwoViews = tuple[Floats, Floats]

# The upper ones keep a slip of the finger from running for hours.
_BOUNDS = {
    "reference_vectors": (3, 1000),
    "epochs": (1, 100),
    "points_per_view": (3, 20_000),
    "neighborhood": (0, 1000),
    "max_iterations": (1, 100),
    "degree": (1, 20),
    "seed": (0, 2**32 - 1),
}


@dataclass(frozen=True, eq=False)
class StereoSomOptions(Options):
    """Options of the stereo SOM; the defaults are the paper's where it gives one.

    Parameters
    ----------
    reference_vectors : int
        The paper's k; 40 to 70 do well there.
    epochs : int
        Of batch training, each time.
    points_per_view : int
        Pixels drawn at random from each view.
    neighborhood : int
        The range n of equation (2).
    max_mismatch : float
        The paper's D_max, which it leaves open: the largest |q_bᵀ F q_a| at which training
        ends. It is about the gap between two rays over their depth. 0.01 lets nearly every
        first training pass, as the paper reports of its own; 0.001 (0.7 mm at 700 mm) keeps
        the loop going, which takes the error on thin devices from 0.5 mm to 0.14 mm.
    max_iterations : int
        Outer limit of the loop, left open by the paper. Each pass pulls the two views' points
        onto common epipolar lines; the gain ends after about ten.
    degree : int
        Of the polynomial that is fitted in the end.
    reach_ends : bool
        Batch training pulls the ends inward (the paper's Figure 5). True adds the two ends of
        the masks, triangulated, before the fit; False is the algorithm as printed.
    seed : int
        Of the random draw.

    Raises
    ------
    ValueError
        Where a number is out of range.
    """

    reference_vectors: int = 50
    epochs: int = 10
    points_per_view: int = 800
    neighborhood: int = 1
    max_mismatch: float = 0.001
    max_iterations: int = 10
    degree: int = 6
    reach_ends: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        for name, (least, most) in _BOUNDS.items():
            check_whole(getattr(self, name), name, least, most)
        if not 0 < self.max_mismatch < np.inf:
            raise ValueError(f"max_mismatch: must be a positive number, is {self.max_mismatch!r}")
        if self.points_per_view < self.reference_vectors:
            raise ValueError(
                f"points_per_view: {self.points_per_view} points cannot train "
                f"{self.reference_vectors} reference vectors; draw more points or ask for fewer"
            )


def stereo_som(observation: Observation, *, options: Options | None = None) -> Reconstruction:
    """Reconstruct the backbone by the paper's Algorithm 1.

    Parameters
    ----------
    observation : Observation
    options : StereoSomOptions, optional

    Returns
    -------
    Reconstruction

    Raises
    ------
    HardFrame
        Where the pixels of this observation do not allow it.

    Examples
    --------
    A quarter circle of radius 60 mm is 94 mm long; its rounded ends add about 1 mm each:

    >>> from stereosom.synthetic import arc, converging_rig, observe
    >>> result = stereo_som(observe(arc(60, 90), radius=1.0, rig=converging_rig(60)))
    >>> 94 < result.backbone.length < 98
    True
    """
    options = options_for(options)
    seen = trim_to_shared_stretch(observation)
    points = _draw(seen, options)
    start, because = _initial_references(seen, options)
    references = train_stereo_map(seen.rig, points, start, options)
    if _reversed(references, start[0]):
        references = references[::-1]
    if options.reach_ends:
        references = _reach_ends(seen, references)
    curve = Backbone.fit_polynomial(references, options.degree)
    return assess(
        curve,
        seen,
        end_deviation=curve.length / (len(references) - 1),
        method=METHOD,
        reason=because,
        radius=options.prior.radius,
    )


def options_for(options: Options | None) -> StereoSomOptions:
    """The method's own options; shared ones are filled up with its defaults."""
    if options is None:
        return StereoSomOptions()
    if isinstance(options, StereoSomOptions):
        return options
    return StereoSomOptions(prior=options.prior, start=options.start)


def _draw(observation: Observation, options: StereoSomOptions) -> TwoViews:
    """Random pixels of each view, the same ones whatever order they came in."""
    drawn = []
    for view, pixels in (("a", observation.pixels_a), ("b", observation.pixels_b)):
        if len(pixels) == 0:
            raise HardFrame(f"view {view}: no device in the picture")
        if len(pixels) < options.reference_vectors:
            raise HardFrame(
                f"view {view}: {len(pixels)} device pixels are fewer than the "
                f"{options.reference_vectors} reference vectors"
            )
        ordered = pixels[np.lexsort(pixels.T)]
        count = min(options.points_per_view, len(ordered))
        rng = np.random.default_rng(options.seed)
        drawn.append(ordered[rng.choice(len(ordered), count, replace=False)])
    return drawn[0], drawn[1]


def _initial_references(observation: Observation, options: StereoSomOptions) -> tuple[Floats, str]:
    """Reference vectors to begin with, base first, (k, 3), and what was assumed.

    The previous curve; else a straight line from the known base in the direction of
    deployment; else one between the triangulated ends of the two masks.
    """
    count, prior = options.reference_vectors, options.prior
    if options.start is not None:
        return options.start.sample(count), ""
    if prior.base is not None and prior.direction is not None and prior.length is not None:
        reach = np.linspace(0.0, prior.length, count)
        return prior.base + reach[:, None] * prior.direction, ""
    ends = find_ends(observation)
    base, tip, because = ends.base, ends.tip, ends.because
    if prior.base is not None:
        if np.linalg.norm(tip - prior.base) < np.linalg.norm(base - prior.base):
            base, tip = tip, base
        because = "the base is the end nearest to the given one"
        base = prior.base
    if prior.direction is not None:
        # Without a length the line goes as far as the device is seen to go.
        length = prior.length or float(np.linalg.norm(tip - base))
        tip = base + length * prior.direction
    share = np.linspace(0.0, 1.0, count)[:, None]
    return (1 - share) * base + share * tip, f"started between the ends of the masks; {because}"


def train_stereo_map(
    rig: StereoRig, points: TwoViews, start: Floats, options: StereoSomOptions
) -> Floats:
    """The loop of Algorithm 1, lines 7 to 19: from a start to ordered reference vectors.

    Parameters
    ----------
    rig : StereoRig
    points : pair of (n, 2) arrays
        Pixels of view a and of view b.
    start : (k, 3) array
        Reference vectors to begin with, mm.
    options : StereoSomOptions

    Returns
    -------
    (k, 3) array
        In order along the device, from one end or the other, mm: those of the pass in which
        the views agreed best.

    Raises
    ------
    HardFrame
        Where training leaves fewer than three.
    """
    trainers = Trainer(points[0]), Trainer(points[1])
    references, best, least, before = start, start, np.inf, np.inf
    for _ in range(options.max_iterations):
        views = _project(rig, references)
        views = _train(trainers, views, options)
        if len(views[0]) < options.reference_vectors:
            views = _train(trainers, _add_references(views, options.reference_vectors), options)
        views = _order(points, views)
        references = triangulate(rig, *views)
        mismatch = float(np.max(_mismatch(rig, views)))
        if mismatch < least:
            best, least = references, mismatch
        # A pass that changes nothing would be followed by more of the same.
        if mismatch < options.max_mismatch or abs(mismatch - before) < 1e-9:
            break
        before = mismatch
    return best


def _project(rig: StereoRig, references: Floats) -> TwoViews:
    for view, camera in (("a", rig.a), ("b", rig.b)):
        if np.any(camera.depth(references) <= 0):
            raise HardFrame(
                f"reference vectors lie behind camera {view}: check the base, the direction and "
                "the length that were given, and the rig"
            )
    return rig.a.project(references), rig.b.project(references)


def _train(
    trainers: tuple[Trainer, Trainer], views: TwoViews, options: StereoSomOptions
) -> TwoViews:
    """Batch training in both views; reference vectors without points are removed.

    One that is nobody's best unit in either view leaves both, or the views would no longer
    correspond by their index.
    """
    for _ in range(options.epochs):
        in_a, count_a = trainers[0].epoch(views[0], options.neighborhood)
        in_b, count_b = trainers[1].epoch(views[1], options.neighborhood)
        used = (count_a > 0) & (count_b > 0)
        views = (in_a, in_b) if used.all() else (in_a[used], in_b[used])
        if len(views[0]) < 3:
            raise HardFrame(
                "training left fewer than three reference vectors: "
                "the start lies too far from the device"
            )
    return views


def _add_references(views: TwoViews, count: int) -> TwoViews:
    """Halve the widest gaps, measured over both views, until there are `count` again."""
    while len(views[0]) < count:
        gaps = sum(np.linalg.norm(np.diff(view, axis=0), axis=1) for view in views)
        missing = count - len(views[0])
        widest = np.sort(np.argsort(-np.asarray(gaps))[:missing])
        in_a, in_b = (
            np.insert(view, widest + 1, (view[widest] + view[widest + 1]) / 2, axis=0)
            for view in views
        )
        views = in_a, in_b
    return views


def _order(points: TwoViews, views: TwoViews) -> TwoViews:
    """Put both views in the order that the adjacency matrix of the widest-spread one gives."""
    spread = [float(np.ptp(view, axis=0).max()) for view in views]
    widest = int(np.argmax(spread))
    best, second = best_two_units(points[widest], views[widest])
    order = order_by_adjacency(adjacency_matrix(best, second, len(views[widest])))
    return views[0][order], views[1][order]


def _mismatch(rig: StereoRig, views: TwoViews) -> Floats:
    """|D| = |q_bᵀ F q_a| of each pair, (k,)."""
    in_a, in_b = (np.column_stack([view, np.ones(len(view))]) for view in views)
    return np.asarray(np.abs(np.sum(in_b * (in_a @ rig.fundamental.T), axis=1)))


def _reversed(references: Floats, base: Floats) -> bool:
    from_base = np.linalg.norm(references[[0, -1]] - base, axis=1)
    return bool(from_base[0] > from_base[1])


def _reach_ends(observation: Observation, references: Floats) -> Floats:
    """Add to (k, 3) reference vectors the ends of the masks, where they lie beyond."""
    rig = observation.rig
    added = []
    for outermost in (references[:3], references[::-1][:3]):
        in_a = _end_of_mask(observation.pixels_a, rig.a.project(outermost))
        in_b = _end_of_mask(observation.pixels_b, rig.b.project(outermost))
        added.append(triangulate(rig, in_a[None], in_b[None]))
    return np.concatenate([added[0], references, added[1]])


def _end_of_mask(pixels: Floats, outermost: Floats) -> Floats:
    """Where the mask ends beyond the first of three projected reference vectors, (2,), px."""
    end, inward = outermost[0], outermost[0] - outermost[2]
    stride = float(np.linalg.norm(inward))
    if stride == 0:
        return np.asarray(end)
    outward = inward / stride
    along = (pixels - end) @ outward
    across = np.abs((pixels - end) @ [-outward[1], outward[0]])
    # The training pulls the end inward by less than two spacings, which is this stride.
    beyond = (along > 0) & (along < 2 * stride) & (across < max(2.0, 0.25 * stride))
    reach = float(np.percentile(along[beyond], 98)) if beyond.any() else 0.0
    return np.asarray(end + reach * outward)
