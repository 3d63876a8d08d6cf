"""Types of the native part. The docstrings of the package describe it."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

__all__ = [
    "Error",
    "FinishedFrames",
    "Image",
    "Progress",
    "Scene",
    "SceneWarning",
    "__version__",
    "compare",
    "find_libraries",
    "finish",
    "finish_frames",
    "merge",
    "read",
]

__version__: str

_Method = Literal["auto", "path", "light", "bdpt", "pm", "ppm", "sppm", "appm", "cppm", "bpm", "vcm", "mlt"]
_Denoise = Literal["auto", "oidn", "own", "none"]
_Filter = Literal["box", "gaussian", "blackman-harris"]
_Picture = Image | str | os.PathLike[str] | NDArray[Any]

class Error(Exception):
    hint: str | None
    place: str
    kind: Literal["usage", "scene", "image", "io", "library", "model", "interrupted"]

class SceneWarning(UserWarning): ...

@final
class Progress:
    @property
    def iteration(self) -> int: ...
    @property
    def iterations(self) -> int | None: ...
    @property
    def seconds(self) -> float: ...
    @property
    def remaining(self) -> float | None: ...
    @property
    def light_paths(self) -> int: ...
    @property
    def error(self) -> float | None: ...
    @property
    def error_of(self) -> str: ...

@final
class Image:
    @staticmethod
    def from_arrays(layers: dict[str, ArrayLike], header: dict[str, Any] | None = None) -> Image: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def layers(self) -> dict[str, dict[str, NDArray[np.float32]]]: ...
    @property
    def picture(self) -> NDArray[np.float32]: ...
    @property
    def header(self) -> dict[str, Any]: ...
    @property
    def descriptions(self) -> dict[str, str]: ...
    def keys(self) -> list[str]: ...
    def save(
        self,
        path: str | os.PathLike[str],
        *,
        compression: Literal["zip", "zips", "piz", "none"] = "zip",
        half: bool = False,
        multi_part: bool = False,
        exr_naming: Literal["plain", "blender"] = "plain",
        colorspace: Literal["rec709", "acescg"] = "rec709",
        exposure: float = 0.0,
        tonemap: Literal["agx", "filmic", "neutral", "srgb"] = "agx",
        contrast: Literal["very-high", "high", "medium-high", "medium", "medium-low", "low", "very-low"] = "medium",
    ) -> None: ...
    def _repr_png_(self) -> bytes: ...
    def __getitem__(self, name: str, /) -> NDArray[np.float32]: ...
    def __contains__(self, name: str, /) -> bool: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...

@disjoint_base
class Scene:
    def __new__(
        cls,
        source: str | os.PathLike[str] | bytes,
        *,
        environment: str | os.PathLike[str] | Sequence[float] | NDArray[Any] | None = None,
        environment_rotation: float | None = None,
        environment_strength: float | None = None,
        light_preset: Literal["studio", "studio-floor", "sky", "none"] | None = None,
        background: Literal["show", "hide"] | None = None,
        light_units: Literal["auto", "radiometric", "photometric"] = "auto",
        glass: Literal["auto", "solid", "thin"] = "auto",
        effects: str | None = None,
        frame: int | None = None,
        frame_rate: float | None = None,
        scene_name: str | None = None,
        animation: str | None = None,
        variant: str | None = None,
        pose: Literal["animated", "rest"] = "animated",
        shutter: Sequence[float] | Literal[0] | None = None,
        allow_outside: bool = False,
        strict: bool = False,
        threads: int = 0,
    ) -> Scene: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def cameras(self) -> list[str]: ...
    @property
    def contents(self) -> dict[str, Any]: ...
    def info(self) -> dict[str, Any]: ...
    def render(
        self,
        *,
        # Options of render.
        time: float | None = None,
        iterations: int | None = None,
        target_error: float | None = None,
        width: int | None = None,
        height: int | None = None,
        crop: Sequence[float] | None = None,
        filter: _Filter | tuple[_Filter, float] | None = None,
        camera: str | None = None,
        orbit: Sequence[float] | str | None = None,
        layers: str | Sequence[str] = "all",
        method: _Method = "auto",
        photons: int | None = None,
        max_depth: int | None = None,
        seed: int = 0,
        finish: bool | None = None,
        denoise: _Denoise = "auto",
        shard: tuple[int, int] | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        checkpoint_every: float = 300,
        overwrite: bool = False,
        resume: str | os.PathLike[str] | None = None,
        threads: int = 0,
        memory: int | None = None,
        reproducible: bool = False,
        light_paths: float | None = None,
        connections: int | None = None,
        merging: float | None = None,
        photon_memory: int | None = None,
        levels: int | None = None,
        eye_paths: int | None = None,
        initial_bandwidth: float | Literal["knn", "footprint"] | None = None,
        knn: int | None = None,
        alpha: float | None = None,
        cppm_grid: tuple[int, int] | None = None,
        cppm_k: float | None = None,
        cppm_beta: float | None = None,
        cppm_significance: float | None = None,
        cppm_plus: bool = False,
        radius_rule: Literal["memoryless", "local"] | None = None,
        kernel: Literal["box", "epanechnikov", "gaussian"] | None = None,
        guide: bool | None = None,
        indirect: Literal["photons", "paths"] | None = None,
        model: str | None = None,
        # End of options of render.
        progress: Callable[[Progress], object] | None = None,
    ) -> Image: ...
    def plan(
        self,
        *,
        # Options of plan.
        time: float | None = None,
        iterations: int | None = None,
        target_error: float | None = None,
        width: int | None = None,
        height: int | None = None,
        crop: Sequence[float] | None = None,
        filter: _Filter | tuple[_Filter, float] | None = None,
        camera: str | None = None,
        orbit: Sequence[float] | str | None = None,
        method: _Method = "auto",
        photons: int | None = None,
        max_depth: int | None = None,
        seed: int = 0,
        finish: bool | None = None,
        denoise: _Denoise = "auto",
        threads: int = 0,
        light_paths: float | None = None,
        connections: int | None = None,
        merging: float | None = None,
        photon_memory: int | None = None,
        levels: int | None = None,
        eye_paths: int | None = None,
        initial_bandwidth: float | Literal["knn", "footprint"] | None = None,
        knn: int | None = None,
        alpha: float | None = None,
        cppm_grid: tuple[int, int] | None = None,
        cppm_k: float | None = None,
        cppm_beta: float | None = None,
        cppm_significance: float | None = None,
        cppm_plus: bool = False,
        radius_rule: Literal["memoryless", "local"] | None = None,
        kernel: Literal["box", "epanechnikov", "gaussian"] | None = None,
        guide: bool | None = None,
        indirect: Literal["photons", "paths"] | None = None,
        model: str | None = None,
        # End of options of plan.
    ) -> dict[str, Any]: ...
    def converge(
        self,
        *,
        methods: Sequence[_Method] | None = None,
        runs: Mapping[str, dict[str, Any]] | None = None,
        iterations: int | None = None,
        time: float | None = None,
        reference: _Picture | None = None,
        reference_method: _Method | None = None,
        reference_iterations: int | None = None,
        reference_time: float | None = None,
        metric: Literal["relmse", "relmse_trimmed", "mse"] = "relmse",
        moments: float | None = None,
        seed: int = 0,
        seeds: int = 1,
        max_depth: int | None = None,
        width: int | None = None,
        height: int | None = None,
        camera: str | None = None,
        threads: int = 0,
        progress: Callable[[dict[str, Any]], object] | None = None,
    ) -> dict[str, Any]: ...

def read(path: str | os.PathLike[str]) -> Image: ...
def compare(
    image: _Picture,
    reference: _Picture,
    *,
    layer: str | None = None,
    relative: bool = False,
    png: str | os.PathLike[str] | None = None,
    page: str | os.PathLike[str] | None = None,
) -> dict[str, Any]: ...
def finish(image: Image, *, denoise: _Denoise = "auto", model: str | None = None, threads: int = 0) -> Image: ...
@final
class FinishedFrames:
    def __iter__(self) -> FinishedFrames: ...
    def __next__(self) -> tuple[int, Image]: ...

def finish_frames(
    pattern: str | os.PathLike[str],
    *,
    frames: Sequence[int] | None = None,
    denoise: _Denoise = "auto",
    model: str | None = None,
    threads: int = 0,
) -> FinishedFrames: ...
def merge(
    paths: Sequence[str | os.PathLike[str]],
    *,
    partial: bool = False,
    finish: bool | None = None,
    denoise: _Denoise | None = None,
    model: str | None = None,
    layers: str | None = None,
    reproducible: bool | None = None,
    threads: int = 0,
) -> Image: ...
def find_libraries() -> dict[str, dict[str, Any]]: ...
