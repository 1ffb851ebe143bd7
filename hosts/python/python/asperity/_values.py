"""Values of Python as texts of a graph file, and progress of long calls."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from typing import Any, Union

import numpy as np

Value = Union[
    bool, int, float, str, "np.generic[Any]", "os.PathLike[str]", Sequence[float], Sequence[str]
]
"""A value of a parameter: number, text, path, True or False, or a list of numbers or texts."""


def as_text(value: Value) -> str:
    """A value as a person would type it behind ``--set NODE.PARAM=``."""
    if isinstance(value, np.generic):
        return as_text(value.item())
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    items = [json.dumps(item) if isinstance(item, str) else as_text(item) for item in value]
    return f"[{', '.join(items)}]"


def progress(show: bool | None, what: str) -> Callable[[int, int], object] | None:
    """A bar of tqdm. Without tqdm, or with ``show=False``, there is none."""
    if show is False:
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    bar = tqdm(desc=what, leave=False, delay=1.0)

    def step(done: int, of: int) -> None:
        bar.total = of
        bar.update(done - bar.n)
        if done >= of:
            bar.close()

    return step
