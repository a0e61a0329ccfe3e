"""Records of a whole session at a rig: rest, pull, hold, release, taps, knocks, a hand that stops the body.

Every piece follows the closed form of a free decay or a simple law of the hand, so the truth of a cut is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tunnel_sim.vocabulary.record import Array


@dataclass
class Log:
    """A record that grows piece by piece; `free` holds the first and last sample of every free decay."""

    rate: float = 200.0
    frequency: float = 3.2
    zeta: float = 0.01
    at: float = 0.0
    pieces: list[Array] = field(default_factory=list)
    free: list[tuple[int, int]] = field(default_factory=list)

    @property
    def size(self) -> int:
        return sum(piece.size for piece in self.pieces)

    def _add(self, piece: Array) -> Log:
        self.pieces.append(piece)
        if piece.size:
            self.at = float(piece[-1])
        return self

    def _clock(self, seconds: float) -> Array:
        return np.arange(round(seconds * self.rate)) / self.rate

    def rest(self, seconds: float) -> Log:
        """The body rests at the centre."""
        return self._add(np.zeros(self._clock(seconds).size))

    def pull(self, to: float, seconds: float) -> Log:
        """A hand moves the body smoothly from where it is."""
        part = self._clock(seconds) / seconds
        return self._add(self.at + (to - self.at) * 0.5 * (1.0 - np.cos(np.pi * part)))

    def hold(self, seconds: float, tremor: float = 0.0, seed: int = 0) -> Log:
        """A hand holds the body, perhaps with a tremor of some Hz."""
        clock, rng = self._clock(seconds), np.random.default_rng(seed)
        shaking = sum(
            np.sin(2.0 * np.pi * f * clock + rng.uniform(0.0, 6.0)) for f in rng.uniform(4.0, 11.0, 4)
        )
        at = self.at
        self._add(at + 0.5 * tremor * np.asarray(shaking))
        self.at = at
        return self

    def swing(
        self,
        amplitude: float,
        seconds: float,
        *,
        phase: float = 0.0,
        frequency: float = 0.0,
        zeta: float = 0.0,
    ) -> Log:
        """A free decay; by another frequency and damping it is that of something else and not counted."""
        clock = self._clock(seconds)
        omega = 2.0 * np.pi * (frequency or self.frequency)
        damping = zeta or self.zeta
        if not frequency:
            self.free.append((self.size, self.size + clock.size))
        return self._add(amplitude * np.exp(-damping * omega * clock) * np.cos(omega * clock + phase))

    def tap(self, speed: float, seconds: float) -> Log:
        """A tap adds to the motion, which goes on; ``speed``: the amplitude of the added motion."""
        clock = self._clock(seconds)
        omega, earlier = 2.0 * np.pi * self.frequency, np.zeros(clock.size)
        if self.free and self.free[-1][1] == self.size and len(self.pieces[-1]) > 2:
            last = self.pieces[-1]
            slope = (last[-1] - last[-2]) * self.rate
            earlier = last[-1] * np.cos(omega * clock) + slope / omega * np.sin(omega * clock)
        self.free.append((self.size, self.size + clock.size))
        swing = earlier + speed * np.sin(omega * clock)
        return self._add(np.exp(-self.zeta * omega * clock) * swing)

    def reading(
        self,
        noise: float = 1e-4,
        seed: int = 1,
        *,
        step: float = 0.0,
        limit: float = np.inf,
        zero: float = 0.0,
        drift: float = 0.0,
    ) -> tuple[Array, Array]:
        """Times and readings: white noise, a sensor's step and limits, its zero and the drift of the centre."""
        values = np.concatenate(self.pieces)
        values = values + zero + noise * np.random.default_rng(seed).standard_normal(values.size)
        values += drift * np.arange(values.size) / values.size
        values = np.clip(values, -limit, limit)
        values = values if step == 0.0 else step * np.round(values / step)
        return np.arange(values.size) / self.rate, values
