"""The compiled half of the package. `Engine`, `Error` and `AsperityWarning` are for everybody."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Progress = Callable[[int, int], object]
_Port = tuple[str, str, int, str | None]

class Error(Exception):
    """Why something was not done: file, line and column, the text with a caret, and help."""

class AsperityWarning(UserWarning):
    """Something that is probably a mistake, or an exception in a Python node."""

class Engine:
    """A graph that runs tick by tick, and whose stylus the caller moves. `Graph.engine` makes one."""

    @property
    def rate(self) -> int:
        """Samples a second."""

    @property
    def tick_hz(self) -> int:
        """Ticks a second."""

    @property
    def ticks(self) -> int:
        """Number of the next tick."""

    @property
    def faults(self) -> int:
        """Failures of nodes so far."""

    @property
    def probes(self) -> list[str]:
        """Names of the probes."""

    def tick(
        self, position: ArrayLike | None = None, force: float | None = None, jump: bool = False
    ) -> NDArray[np.float32]:
        """Move the stylus and run one tick.

        Parameters
        ----------
        position
            x, y and z of the stylus in mm; z points up. Left out, it stays.
        force
            Force with which the hand presses in N, for graphs that use it.
        jump
            Whether the stylus was put down elsewhere, so that the way there is no motion.

        Returns
        -------
        Samples of this tick, ``(n,)``, or ``(n, channels)`` for several channels or none.
        """

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Values of a probe in the last tick: ``(values,)`` or ``(samples,)``, frames ``(0 or 1, bins)``."""

    def unit(self, name: str) -> str:
        """Unit of a probe."""

    def reset(self) -> None:
        """Go back to tick 0."""

class Kind:
    def __new__(
        cls,
        make: Callable[[], object],
        types: tuple[object, object, object],
        name: str,
        summary: str,
        inputs: Sequence[_Port],
        outputs: Sequence[_Port],
        params: Sequence[tuple[str, object]],
        latency_ms: float,
    ) -> Kind: ...
    @property
    def name(self) -> str: ...

class Felt:
    rate: int
    faults: int
    probes: list[str]
    def take_audio(self) -> NDArray[np.float32]: ...
    def probe(self, name: str) -> tuple[NDArray[Any], float, str, NDArray[np.float64], float]: ...
    def report(self) -> str: ...

class Graph:
    svg: str
    tick_hz: int
    audio_hz: int
    seed: int
    nodes: list[tuple[str, str]]
    def __new__(
        cls,
        graph: str,
        is_text: bool,
        set: Sequence[str],
        keywords: Sequence[tuple[str, str]],
        kinds: Sequence[Kind],
    ) -> Graph: ...
    def render(
        self,
        file: str | None,
        table: tuple[Sequence[str], NDArray[np.float64]] | None,
        map: Sequence[str],
        repeat: bool,
        probes: Sequence[str],
        seconds: float | None,
        seed: int | None,
        sleep: bool,
        progress: _Progress | None,
    ) -> Felt: ...
    def lag(self) -> str: ...
    def engine(self, probes: Sequence[str]) -> Engine: ...

def version() -> str: ...
def materials(library: str) -> list[tuple[str, str | None, str, list[str]]]: ...
def invert(
    magnitudes: NDArray[np.float32],
    rate: int,
    phase: str,
    scale: str,
    seed: int,
    kinds: Sequence[Kind],
) -> tuple[NDArray[np.float32], int]: ...
def compare(
    methods: Sequence[str],
    vectors: str,
    kinds: Sequence[Kind],
    progress: _Progress | None,
) -> tuple[str, str, str, str]: ...
def figures(
    rendered: NDArray[np.float64],
    truths: Sequence[NDArray[np.float64]],
    rate: float,
    truth_rate: float,
) -> list[tuple[str, float]]: ...
def convergence(
    signal: NDArray[np.float64], magnitudes: NDArray[np.float32], rate: int
) -> list[float]: ...
def precision(rendered: NDArray[np.float64], reference: NDArray[np.float64]) -> float: ...
def pitch(signal: NDArray[np.float64], rate: float, about_s: float) -> tuple[float, float]: ...
def fit_ar(
    force: NDArray[np.float64],
    speed: NDArray[np.float64],
    acceleration: NDArray[np.float64],
    rate: float,
    description: str,
    order: int | None,
    max_order: int,
    model_hz: int,
    high_pass_hz: float,
) -> tuple[str, float, int, int]: ...
def study_log(path: str) -> str: ...
def tradeoff(path: str | None) -> str: ...
def choose(
    path: str | None,
    budget_us: float | None,
    max_lag_ms: float | None,
    tick_hz: int | None,
    by: Sequence[str],
    strict: bool,
) -> str | None: ...
