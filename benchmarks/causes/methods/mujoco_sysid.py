"""MuJoCo's system identification toolbox, `mujoco.sysid`: every cause that MJCF can express, weighed by BIC."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.causes.entry import UNKNOWN, About, answer_of, main
from benchmarks.causes.methods.forward_bic import bic, weighed
from benchmarks.causes.mjcf import BOUNDS, FINER, NOMINAL, ROWS, SUBSTEPS, ToolboxFit, ToolboxRig
from benchmarks.causes.moments import CLOSED, DETECTED, NOT_SEEN, Array

MOST, FITTED = 3, 2
NAMES = (*BOUNDS, "gravity_stiffness", "spring_miscalibration")
ABOUT = About(
    "mujoco.sysid",
    f"MuJoCo 4.0's toolbox with optimizer='mujoco' and x_scale='jac'; RK4 at {ROWS * SUBSTEPS} steps per cycle, "
    f"{FINER} times as many with dry friction; records as means of {ROWS} blocks per cycle; forward selection by "
    f"BIC of up to {MOST} causes, of which the {FITTED} that the Jacobian ranks first are fitted at every step; "
    f"none, or no further one, below {DETECTED} noise variances, `unknown` where the set leaves {CLOSED:g} of the "
    "gap; probabilities are BIC weights of all sets fitted; the steps and where to stop were chosen with "
    "knowledge of the truths of nine campaigns",
    (*NAMES, UNKNOWN),
    NOT_SEEN,
)


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    rig = ToolboxRig(folder)
    start = rig.fit((), NOMINAL, np.zeros(len(NOMINAL) + 2 * len(rig.trials)))
    before, gap = coefficients(rig, start), start.chi2 / start.residuals.size
    if gap < DETECTED:
        return answer_of([], dict.fromkeys(NAMES, 0.01), (), {"before": before, "after": before})
    best, fitted = start, [start]
    while len(best.causes) < MOST and best.chi2 / best.residuals.size > DETECTED:
        found = [rig.fit(*one) for one in ranked(rig, best)[:FITTED]]
        fitted += found
        following = min(found, key=score, default=best)
        if score(following) >= score(best):
            break
        best = following
    stated = {"before": before, "after": coefficients(rig, best)}
    sets, inclusion = weighed([(f.causes, score(f)) for f in fitted])
    if gap - best.chi2 / best.residuals.size < CLOSED * (gap - 1.0):
        return answer_of([UNKNOWN], {**{n: 0.3 * p for n, p in inclusion.items()}, UNKNOWN: 0.7}, (), stated)
    return answer_of(best.causes, inclusion, sets, stated)


def score(fit: ToolboxFit) -> float:
    """Bayesian information criterion of a fit."""
    return bic(fit.chi2, len(fit.names) - len(NOMINAL), fit.residuals.size)


def ranked(rig: ToolboxRig, best: ToolboxFit) -> list[tuple[tuple[str, ...], tuple[str, ...], Array]]:
    """Fits to make, in increasing order of the BIC that the linear model predicts.

    Args:
        best: fit to which a cause is added.
    """
    found = []
    size = len(best.names)
    for cause, own in rig.candidates(best.causes):
        names, which = (*best.names, *own), range(size, size + len(own))
        x = np.concatenate((best.x[:size], np.zeros(len(own)), best.x[size:]))
        params = rig.params(names, x)
        left = best.residuals
        if cause == "coulomb_friction":  # with finer steps
            left = np.concatenate([r for one in rig.runs(params) for r in one(x, params)[0]])
        new = rig.jacobian(params, x, left, which, 0.01, 0)[:, which]
        columns = np.column_stack((best.jacobian, new))
        step = np.linalg.lstsq(columns, -best.residuals, rcond=1e-10)[0]
        if BOUNDS.get(cause, (-1.0,))[0] == 0.0 and step[-1] <= 0.0:
            continue  # only the opposite sign, which is excluded, would improve the fit
        rest = best.residuals + columns @ step
        x[which] = np.clip(step[best.x.size :], -10.0, 10.0)
        expected = bic(float(rest @ rest), len(names) - len(NOMINAL), rest.size)
        found.append((expected, ((*best.causes, cause), names, x)))
    return [one for _, one in sorted(found, key=lambda one: one[0])]


def coefficients(rig: ToolboxRig, fit: ToolboxFit) -> dict[str, dict[str, float]]:
    """Cnβ and Cnr with the toolbox's standard deviations, 1/rad, where the wind was on."""
    from mujoco import sysid

    if not rig.stated:
        return {}
    std = np.sqrt(np.diag(sysid.calculate_intervals([fit.residuals], fit.jacobian)[0]))
    at = {name: (fit.names.index(name), 0.01 * rig.unit[name]) for name in rig.cn}
    return {
        name: {"value": rig.cn[name] + unit * float(fit.x[i]), "std": unit * float(std[i])}
        for name, (i, unit) in at.items()
        if np.isfinite(std[i]) and std[i] > 0.0
    }


if __name__ == "__main__":
    main(answer)
