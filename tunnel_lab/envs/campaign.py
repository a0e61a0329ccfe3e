"""``tunnel_sim/Campaign-v0``: an episode is a campaign, a step is a run; docs/reference/envs/campaign.md."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from identification.campaign.belief import information_gain
from identification.estimate import PARAMETERS
from identification.printing import SYMBOLS
from tunnel_lab.envs.menu import PRESETS, WHERE, Costs, Preset, make_menu, preset_sensor, refusal
from tunnel_lab.envs.session import (
    LARGE,
    CampaignSession,
    EpisodeConditions,
    Knowledge,
    answers,
    diagnostic_information,
    draw_truth,
    first_knowledge,
    probabilities,
)
from tunnel_sim.effects import effect_class
from tunnel_sim.effects.registry import known_effects
from tunnel_sim.envs import arguments_of, refuse_unknown
from tunnel_sim.envs.episode_conditions import refuse_long
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.arguments import (
    POSITIVE,
    Number,
    checked_choice,
    checked_names,
    checked_numbers,
    env_errors,
)
from tunnel_sim.vocabulary.between_runs import Scatter
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.record import Array

Observation = dict[str, Array]
WIDTH, HEIGHT = 960, 480
_DPI = 100
PartsT = TypeVar("PartsT", Costs, Scatter)


class CampaignEnv(gym.Env[Observation, NDArray[np.int64]]):
    """Choose the runs of a campaign; the reward is the information gained minus the cost.

    Arguments that are None take the preset's value (`tunnel_lab.envs.menu`); docs/reference/envs/campaign.md lists
    all.

    Args:
        preset: ``identification`` or ``diagnosis``.
        simulation: ``linear``: runs by the closed form of the linear model, their estimate to first order in the
            noise; ``full``: runs in MuJoCo, estimated by a fit. None: ``full`` for a diagnosis, else ``linear``.
        noise_std: noise of the sensor, rad.
        sample_rate: sample rate of the sensor, Hz.
        severities: the effects that the diagnosis considers, each with the range of its severity in its unit;
            only for the diagnosis preset.
        targets: relative standard deviations (fractions) of Cnβ and Cnr at which an identification ends.
        probability: probability of one effect at which a diagnosis ends.
        costs: rig time of a run, `Costs` or some of its times by name, s; None: the defaults of `Costs`.
        seconds_per_nat: rig time that is worth a nat, s.
        rig: path of a rig description; None takes the packaged rig.
        scatter: differences between the runs, a `Scatter` or some of its numbers by name; None: no differences.
        **unknown: other names, which are refused.

    Raises:
        EnvError: when an argument is out of range or a name is unknown.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 1}  # noqa: RUF012

    def __init__(
        self,
        *,
        preset: str = "identification",
        simulation: str | None = None,
        springs: Sequence[int] | None = None,
        wind_speeds: Sequence[float] | None = None,
        release_angles_deg: Sequence[float] | None = None,
        durations: Sequence[float] | None = None,
        noise_std: float | None = None,
        sample_rate: float | None = None,
        severities: Mapping[str, tuple[float, float]] | None = None,
        targets: tuple[float, float] = (0.01, 0.05),
        probability: float = 0.9,
        costs: Costs | Mapping[str, float] | None = None,
        seconds_per_nat: float = 600.0,
        max_runs: int | None = None,
        rig: Path | str | None = None,
        scatter: Scatter | Mapping[str, float] | None = None,
        expose_truth: bool = False,
        render_mode: str | None = None,
        **unknown: object,
    ) -> None:
        refuse_unknown(unknown, arguments_of(CampaignEnv), WHERE)
        base = PRESETS[checked_choice(preset, tuple(PRESETS), "preset", WHERE)]
        self.severities = _checked_severities(base, severities)
        if simulation is not None:
            checked_choice(simulation, ("linear", "full"), "simulation", WHERE)
        if render_mode is not None:
            checked_choice(render_mode, self.metadata["render_modes"], "render_mode", WHERE)
        if simulation == "linear" and self.severities:
            raise refusal("a diagnosis needs the full simulation", "leave simulation out")
        if rig is not None and not isinstance(rig, str | Path):
            raise refusal(f"rig = {rig!r} is not a path", "give the path of a rig description (TOML)")
        with env_errors(WHERE, "rig"):
            loaded = load_rig(None if rig is None else Path(rig))
        of_cn_beta, of_cn_r = checked_numbers(targets, "targets", WHERE, POSITIVE, length=2)
        self.targets = (of_cn_beta, of_cn_r)
        self.probability = Number(most=1.0, above=True).checked(probability, "probability", WHERE)
        self.seconds_per_nat = Number(above=True, unit="s").checked(seconds_per_nat, "seconds_per_nat", WHERE)
        self.max_runs = int(
            Number(least=1, most=limits.CAMPAIGN_RUNS, whole=True).checked(
                base.max_runs if max_runs is None else max_runs, "max_runs", WHERE
            )
        )
        self.conditions = EpisodeConditions(
            rig=loaded,
            sensor=preset_sensor(base, noise_std, sample_rate),
            menu=make_menu(
                loaded,
                base.springs if springs is None else springs,
                base.wind_speeds if wind_speeds is None else wind_speeds,
                base.release_angles_deg if release_angles_deg is None else release_angles_deg,
                base.durations if durations is None else durations,
            ),
            costs=_by_name(costs, Costs, "costs"),
            effects=tuple(self.severities),
            linear=not self.severities and simulation != "full",
            scatter=_by_name(scatter, Scatter, "scatter"),
            max_runs=self.max_runs,
        )
        for duration in self.conditions.menu.durations:
            refuse_long(duration, self.conditions.sensor.sample_rate, "durations", WHERE)
        self.expose_truth = expose_truth
        self.render_mode = render_mode
        menu, rates = self.conditions.menu, self.conditions.costs
        self.action_space = spaces.MultiDiscrete(list(menu.shape))
        stiffest = max(stiffness for _, stiffness in menu.springs)
        highest = [stiffest, max(menu.wind_speeds), max(menu.release_angles), max(menu.durations)]
        longest = rates.setup + rates.spring_change + rates.speed_change + highest[3]
        most_progress = np.array([self.max_runs, self.max_runs * longest])
        parts: dict[str, spaces.Space[Any]] = {
            "estimate": spaces.Box(-LARGE, LARGE, (4,), np.float64),
            "covariance": spaces.Box(-LARGE, LARGE, (16,), np.float64),
            "last_run": spaces.Box(np.zeros(4), np.array(highest), dtype=np.float64),
            "progress": spaces.Box(np.zeros(2), most_progress, dtype=np.float64),
        }
        if self.severities:
            parts["probabilities"] = spaces.Box(0.0, 1.0, (len(self.severities) + 3,), np.float64)
        self.observation_space = cast("spaces.Space[Observation]", spaces.Dict(parts))
        self.known: Knowledge = first_knowledge(self.conditions)
        self._session: CampaignSession | None = None
        self._total_gain = 0.0

    @property
    def campaign(self) -> Campaign:
        """The runs of this episode so far, for `identify` and `diagnose`."""
        return self.known.campaign

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a campaign on a rig of unknown truth.

        Args:
            seed: seed of the truth and all noise; None continues with the present generator.
            options: ``truth`` (coefficients by name, SI) and ``effects`` (parameters by effect) instead of drawn
                values.

        Raises:
            TunnelError: for an unknown option, coefficient or effect, or a number out of range.
        """
        super().reset(seed=seed)
        truth = draw_truth(self.np_random, self.severities, options)
        if self.conditions.linear and truth.effects:
            remedy = "make the environment with simulation='full'"
            raise refusal("option effects: effects are not part of linear theory", remedy)
        self._session = CampaignSession(self.conditions, truth, self.np_random.spawn(1)[0])
        self.known = first_knowledge(self.conditions)
        if self.render_mode == "human":
            self.render()
        self._total_gain = 0.0
        return self.known.observation(), self._info(0.0)

    def step(self, action: Iterable[int]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Make a run: indices of spring, wind speed, release angle and duration in the menu.

        Returns:
            Observation, reward (information gained, nats, less rig time over ``seconds_per_nat``), whether the
            goal is reached, whether the runs are used up, info.

        Raises:
            TunnelError: when the action is not in the menu, there was no reset, or the runs are used up.
        """
        if self._session is None:
            raise refusal("there is no episode", "call reset() first")
        if len(self.known.choices) >= self.max_runs:
            raise refusal("the runs of the episode are used up", "call reset() first")
        before = self.known
        self.known = self._session.perform(before, self.conditions.menu.choice(action))
        if self.conditions.effects:
            gain = diagnostic_information(self.known) - diagnostic_information(before)
        else:
            gain = information_gain(before.belief, self.known.belief)
        self._total_gain += gain
        reward = gain - self.known.costs[-1] / self.seconds_per_nat
        done = reached(self.known, self.targets, self.probability)
        truncated = not done and len(self.known.choices) >= self.max_runs
        if self.render_mode == "human":
            self.render()
        info = self._info(gain)
        if done or truncated:
            info["campaign"] = self.campaign
        return self.known.observation(), float(reward), done, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Print the last run and the estimate, or return `picture`, according to ``render_mode``."""
        if self.render_mode == "human":
            print(line_of(self.known), flush=True)
        elif self.render_mode == "rgb_array":
            return picture(self.known, self.targets, self.probability)
        else:
            gym.logger.warn(
                "render() without a render_mode: give render_mode='rgb_array' or 'human' to make()"
            )
        return None

    def _info(self, gain: float) -> dict[str, Any]:
        known = self.known
        info: dict[str, Any] = {
            "status": known.status,
            "runs": len(known.choices),
            "rig_time_s": known.rig_time,
            "step_information_nats": float(gain),
            "total_information_nats": float(self._total_gain),
            "relative_std": {name: known.belief.relative_std(name) for name in PARAMETERS},
        }
        if self.conditions.effects:
            named = zip(answers(self.conditions.effects), probabilities(known).tolist(), strict=True)
            info["answers"] = dict(named)
        if self.expose_truth and self._session is not None:
            info["truth"] = self._session.truth.to_json_dict()
        return info


def _by_name(given: object, kind: type[PartsT], name: str) -> PartsT:
    """A dataclass of numbers: as given, or from some of its numbers by name; None: its defaults."""
    if isinstance(given, kind):
        return given
    known = [one.name for one in dataclasses.fields(kind)]
    return kind(**checked_names({} if given is None else given, known, name, WHERE))


def _checked_severities(
    preset: Preset, given: Mapping[str, tuple[float, float]] | None
) -> dict[str, tuple[float, float]]:
    if given is not None and not (preset.severities and given):
        remedy = "give preset='diagnosis' and at least one effect with the range of its severity"
        raise refusal("severities are for the diagnosis preset only", remedy)
    stated = preset.severities if given is None else given
    ranges = {}
    for name, bounds in checked_names(
        stated, [kind.name for kind in known_effects()], "severities", WHERE
    ).items():
        severity = effect_class(name).parameters()[0]
        kind = Number(above=True, unit=severity.unit)
        low, high = checked_numbers(bounds, f"severities[{name!r}]", WHERE, kind, length=2)
        if low > high:
            remedy = f"give the lower end of {severity.name} first{beside(severity.unit, ', in ')}"
            raise refusal(f"severities[{name!r}] = {bounds!r} is not a range", remedy)
        ranges[name] = (low, high)
    return ranges


def reached(known: Knowledge, targets: tuple[float, float], probability: float) -> bool:
    """Whether a campaign has reached its goal.

    Args:
        targets: relative standard deviations of Cnβ and Cnr (fractions), used without a vocabulary.
        probability: probability of one effect alone, used with a vocabulary.
    """
    if not known.choices:
        return False
    if known.conditions.effects:
        return bool(probabilities(known)[1:-2].max() >= probability)
    belief = known.belief
    return belief.relative_std("cn_beta") <= targets[0] and belief.relative_std("cn_r") <= targets[1]


def line_of(known: Knowledge) -> str:
    """The last run and the estimate after it, in one line."""
    if known.last is None:
        return "new campaign"
    belief = known.belief
    words = ", ".join(
        f"{SYMBOLS[name]} = {value:.4g} ± {belief.std(name):.2g} 1/rad"
        for name, value in zip(("cn_beta", "cn_r"), belief.values, strict=False)
    )
    text = f"run {len(known.choices)}: {known.last.words}; {words}; rig time {known.rig_time / 60.0:.1f} min"
    if known.conditions.effects:
        chances = probabilities(known)
        best = int(np.argmax(chances))
        text += f"; {answers(known.conditions.effects)[best]} (probability {chances[best]:.2f})"
    return text if known.status == "ok" else f"{text}; {known.status}"


def picture(known: Knowledge, targets: tuple[float, float], probability: float) -> NDArray[np.uint8]:
    """The last record, and the standard deviations or probabilities so far; RGB, shape (480, 960, 3).

    Args:
        targets: relative standard deviations of Cnβ and Cnr, fractions.
        probability: probability at which a diagnosis ends.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from identification.show.style import COLOURS
    from tunnel_lab.plotting.runs import WIND_OFF, WIND_ON

    figure = Figure(figsize=(WIDTH / _DPI, HEIGHT / _DPI), dpi=_DPI, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)  # only partly typed by matplotlib
    angles, right = figure.subplots(1, 2)
    angles.set(xlabel="time [s]", ylabel="angle β [rad]")
    if known.last is None or not known.runs:
        angles.set_title("no run yet", fontsize=10)
    else:
        run = known.runs[-1]
        colour = WIND_ON if run.wind_on else WIND_OFF
        angles.plot(run.record.time_s, run.record.yaw_rad, ".", markersize=2, color=colour)
        angles.set_title(f"run {len(known.choices)}: {known.last.words}", fontsize=10)
    if known.conditions.effects:
        names = [name.replace("_", "\n") for name in answers(known.conditions.effects)]
        right.bar(names, probabilities(known), color=COLOURS[0])
        right.axhline(probability, color=COLOURS[1], linestyle="--", linewidth=1)
        right.set(ylim=(0.0, 1.0), ylabel="probability")
        right.tick_params(axis="x", labelsize=7)
    else:
        for place, (name, target) in enumerate(zip(("cn_beta", "cn_r"), targets, strict=True)):
            spread = [100.0 * belief.relative_std(name) for belief in known.beliefs]
            right.semilogy(range(len(spread)), spread, "o-", color=COLOURS[place], label=SYMBOLS[name])
            right.axhline(100.0 * target, color=COLOURS[place], linestyle="--", linewidth=1)
        right.set(xlabel="informative runs", ylabel="standard deviation [%]")
        right.set_xticks(range(0, len(known.beliefs), 1 + len(known.beliefs) // 10))
        right.legend(loc="upper right")
    right.set_title(f"{known.rig_time / 60.0:.0f} min of rig time; dashed: the goal", fontsize=10)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3], dtype=np.uint8)
