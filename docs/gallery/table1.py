"""The 2010 paper's Table I, short: one pose of its mock-up instead of twenty.

`stereosom experiment table1` repeats all of it and takes minutes.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np

from stereosom_plugin.experiments import table1

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
counts = (20, 40, 50, 60, 80)

# The mock-up is photographed by a renderer, its edges found as in the paper, and 800 of them
# given to the stereo self-organizing map.
print(table1.run(output, poses=2, counts=counts, figures=False))
rows = np.genfromtxt(output / "table1.csv", delimiter=",", names=True)
ours = rows[rows["max_mismatch"] == table1.MISMATCHES[1]]

matplotlib.use("Agg")
figure = matplotlib.figure.Figure(figsize=(6.4, 4), layout="constrained")
axes = figure.add_subplot()
axes.errorbar(counts, *np.array([table1.PAPER[k][:2] for k in counts]).T, fmt="s-", label="paper")
axes.plot(counts, ours["error_mm"], "o-", label="here, registered as there")
axes.plot(counts, ours["error_unregistered_mm"], "o--", label="here, not registered")
axes.set(xlabel="reference vectors", ylabel="mean error, mm", ylim=(0, None))
axes.legend(frameon=False)
figure.savefig(output / "table1.png", dpi=110)
