"""The rig's equations of motion, written from the vocabulary of effects and solved by SciPy.

Nothing here is shared with the compiled moment law: parameters have the same names, the terms are written
anew. Where a term has a kink or a jump, integration stops there and starts again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import copysign, exp, pi, sin, sqrt, tanh

import numpy as np
from scipy.integrate import solve_ivp

AREA, LENGTH, WIDTH = 0.036, 0.625, 0.225  # m2, m, m: Table I


@dataclass(frozen=True)
class Oracle:
    """One run. `wind` and `forcing` are functions of time with kinks at `breaks`."""

    stiffness: float
    damping: float
    inertia: float
    cn_beta: float
    cn_r: float
    density: float
    wind: Callable[[float], float]
    release: float
    terms: dict[str, float] = field(default_factory=dict)
    forcing: Callable[[float], float] = lambda _: 0.0
    breaks: tuple[float, ...] = ()
    compliance: float = 0.0  # of the rod; 0: rigid
    share: float = 0.0
    twist_damping: float = 0.0

    def term(self, name: str) -> float:
        return self.terms.get(name, 0.0)

    def air(self, t: float, angle: float, rate: float, lagged: float) -> float:
        speed = self.wind(t)
        if speed <= 0.0:
            return 0.0
        pressure = 0.5 * self.density * speed**2 * AREA * LENGTH
        ka, ca = pressure * self.cn_beta, 0.5 * self.density * speed * AREA * LENGTH**2 * self.cn_r
        lag = self.term("aero_lag")
        seen = angle if lag == 0.0 else lagged if lag > 0.0 else angle + (angle - lagged)
        moment = ka * seen * (1.0 + self.raised(abs(angle), "moment_cubic", 2.0))
        moment += ka * self.term("flow_angle")
        moment += ca * (1.0 + self.raised(abs(angle), "damping_quadratic", 2.0)) * rate
        if self.term("shedding_amplitude"):
            cycles = self.term("strouhal_number") * speed * t / WIDTH
            phase = 2 * pi * cycles + self.term("shedding_phase")
            moment += pressure * self.term("shedding_amplitude") * sin(phase)
        return moment + pressure * self.forcing(t)

    def raised(self, size: float, term: str, textbook: float, reference: float = 0.2) -> float:
        """A coefficient times the textbook's power of the size, or times one that equals it at the reference."""
        coefficient = self.term(term)
        if coefficient == 0.0:
            return 0.0
        power = self.term(f"{term}_exponent") or textbook
        return coefficient * size**power * reference ** (textbook - power)

    def mechanism(self, angle: float, rate: float) -> float:
        play = self.term("free_play")
        stretched = max(angle - play, 0.0) + min(angle + play, 0.0) if play > 0.0 else angle
        moment = -self.stiffness * stretched - self.damping * rate
        moment -= self.raised(abs(rate), "quadratic_damping", 2.0, 2.0) * copysign(1.0, rate)
        moment -= self.term("loss_factor") * self.stiffness / sqrt(self.stiffness / self.inertia) * rate
        moment -= self.stiffness * (
            self.raised(abs(angle), "stiffness_cubic", 3.0) * copysign(1.0, angle)
            + self.raised(abs(angle), "stiffness_quadratic", 2.0)
        )
        return moment - self.term("gravity_stiffness") * sin(angle - self.term("gravity_angle"))

    def friction(self, speed: float, angle: float) -> float:
        """Moment against a slip, at a rate without its sign."""
        level, power = self.term("friction_moment"), self.term("friction_exponent")
        hung = self.term("gravity_stiffness") * sin(angle - self.term("gravity_angle"))
        hung += self.term("load_stiffness") * sin(angle - self.term("load_angle"))
        level += self.term("friction_load") * abs(hung)
        if power:
            level *= (speed / 2.0) ** power
        if self.term("friction_saturation"):
            level *= tanh(speed / self.term("friction_saturation"))
        if self.term("friction_peak"):
            level *= 1.0 + self.term("friction_peak") * exp(-((speed / self.term("friction_peak_rate")) ** 2))
        return level

    def others(self, t: float, y: Sequence[float]) -> tuple[float, float]:
        """Moments on the spring's end without friction, and on the body (0 where the rod is rigid)."""
        angle, rate, twist, twist_rate, lagged, _ = y
        air = self.air(t, angle + twist, rate + twist_rate, lagged)
        if self.compliance == 0.0:
            return self.mechanism(angle, rate) + air, 0.0
        rod = twist / self.compliance + self.twist_damping * twist_rate
        return self.mechanism(angle, rate) + rod, air - rod

    def derivative(self, t: float, y: np.ndarray, slip: int | None) -> list[float]:
        """`slip` is the sign of the rate under friction, None at rest."""
        angle, rate, twist, twist_rate, lagged, deflection = state = y.tolist()
        end, body = self.others(t, state)
        friction, reach, yielding = self.friction(abs(rate), angle), self.term("presliding"), 0.0
        share = 1.0  # of the friction's moment, against the slip
        if reach > 0.0 and slip is not None:  # Dahl's: slip is the side to which the motion goes
            share = slip * deflection / reach
            yielding = rate * (1.0 - slip * deflection / reach)
        flexible = self.compliance > 0.0
        upper = self.inertia * (self.share if flexible else 1.0)
        acceleration = 0.0 if slip is None else (end - slip * share * friction) / upper
        twisting = body / (self.inertia * (1.0 - self.share)) - acceleration if flexible else 0.0
        speed = self.wind(t)
        lag = abs(self.term("aero_lag")) * LENGTH / speed if speed > 0.0 else 0.0
        following = (angle + twist - lagged) / lag if lag > 0.0 else 0.0
        return [0.0 if slip is None else rate, acceleration, twist_rate, twisting, following, yielding]

    def start(self) -> np.ndarray:
        end = self.release / (1.0 + self.stiffness * self.compliance)
        return np.array([end, 0.0, self.release - end, 0.0, self.release, 0.0])

    def solve(self, samples: int, sample_rate: float) -> np.ndarray:
        """Angle of the spring's end from time 0 on, rad, shape (samples,)."""
        times = np.arange(samples) / sample_rate
        duration = float(times[-1])
        angle = np.empty(samples)
        stops = sorted({*(b for b in self.breaks if 0.0 < b < duration), duration})
        t, y = 0.0, self.start()
        for stop in stops:
            while t < stop:
                t, y = self._leg(t, y, stop, times, angle)
        return angle

    def _leg(
        self, t: float, y: np.ndarray, stop: float, times: np.ndarray, angle: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Integrate to `stop` or to the next kink or jump of the law."""
        friction, play = self.term("friction_moment") + self.term("friction_load"), self.term("free_play")
        slip: int | None = 0
        events = []
        if friction > 0.0:
            rest = self._way_from_rest if self.term("presliding") > 0.0 else self._slip_from_rest
            slip = int(np.sign(y[1])) or rest(t, y)
            if slip is None:
                events.append(lambda t, y: self.friction(0.0, y[0]) - abs(self.others(t, y)[0]))
                events[-1].direction = -1
            else:
                events.append(lambda _, y: y[1])
                events[-1].direction = -slip
        if play > 0.0:
            for edge in (play, -play):  # only a crossing onward: this leg may start on the edge itself
                past = y[0] > edge if abs(y[0] - edge) > 1e-10 else y[1] > 0.0
                events.append(lambda _, y, edge=edge: y[0] - edge)
                events[-1].direction = -1 if past else 1
        for event in events:
            event.terminal = True
        leg = solve_ivp(
            lambda t, y: self.derivative(t, y, slip),
            (t, stop), y, method="DOP853", rtol=1e-11, atol=1e-14, events=events, dense_output=True,
        )  # fmt: skip
        here = (times >= t) & (times <= leg.t[-1])
        if np.any(here):
            angle[here] = leg.sol(times[here])[0]
        end = leg.y[:, -1]
        if events and leg.t_events[0].size and friction > 0.0:
            end[1] = 0.0
        return float(leg.t[-1]), end

    def _slip_from_rest(self, t: float, y: np.ndarray) -> int | None:
        other = self.others(t, y)[0]
        # just broken away counts as slipping: the event above ends a rest on the edge
        edge = self.friction(0.0, y[0]) * (1.0 - 1e-12)
        return None if abs(other) < edge else int(np.sign(other))

    def _way_from_rest(self, t: float, y: np.ndarray) -> int:
        end, body = self.others(t, y)
        end -= self.friction(0.0, y[0]) * y[5] / self.term("presliding")
        return 1 if (end if abs(end) > 1e-12 else body) > 0.0 else -1  # from balance it follows the body


def closed_form(
    t: np.ndarray, release: float, stiffness: float, damping: float, inertia: float
) -> np.ndarray:
    """Angle of the linear rig released from rest; stiffness and damping are the wind-on totals."""
    zeta_omega = damping / (2.0 * inertia)
    omega = sqrt(stiffness / inertia - zeta_omega**2)
    return release * np.exp(-zeta_omega * t) * (np.cos(omega * t) + zeta_omega / omega * np.sin(omega * t))
