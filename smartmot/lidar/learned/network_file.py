"""Networks as ONNX files that say themselves how clouds go in and what comes out.

The metadata `smartmot` of a file is a JSON object: `version`, `grid` (`PillarGrid`), `classes`, `overlap`,
`score_scale` and `score_offset` (of the logits, by class), `least_score` (by class; a file may leave it out),
and what it was made from.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import _smartmot
from smartmot.arrays import FloatArray
from smartmot.errors import ConfigError
from smartmot.lidar.learned.decoding import Decoder
from smartmot.lidar.learned.pillars import FEATURES, PillarGrid, Pillars
from smartmot.types import CATEGORIES

METADATA = "smartmot"
"""Key of a file's metadata."""

VERSION = 1
"""Of the metadata and of what goes in and comes out."""

INPUTS, OUTPUT = ("features", "cell"), "output"

INPUT_TYPES = ("tensor(float)", "tensor(int64)")

EXTERNAL = b"\n\x08location"
"""Of every tensor whose values are in another file: the key that names it, as ONNX writes it (onnx.proto3,
`TensorProto.external_data`)."""

LEAST_SCORE = 0.3
"""Of boxes of networks that say none: trackers here drop those under it."""

LARGEST_BYTES = 200_000_000
"""Of a file; networks for a processor have some megabytes."""


@dataclass(frozen=True, slots=True)
class LearnedConfig:
    """A network and how sure its boxes have to be.

    Args:
        path: the ONNX file.
        digest: SHA-256 of the file, in hexadecimal digits; empty: taken from the file.
        least_score: boxes with a lower score are left out, of all classes or of each; None: what the file
            says of each class, see `Network.least_score`.

    Raises:
        ConfigError: the file is missing, is no network of this form, or not the one with that digest.
    """

    path: Path
    digest: str = ""
    least_score: float | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        given = self.least_score if isinstance(self.least_score, tuple) else (self.least_score,)
        if any(score is not None and not 0.0 <= score <= 1.0 for score in given):
            raise ConfigError(f"least_score: must lie in [0, 1], got {self.least_score}")
        digest = hashlib.sha256(_content(self.path)).hexdigest()
        if self.digest not in ("", digest):
            raise ConfigError(f"{self.path}: is not the network with SHA-256 {self.digest}, but {digest}")
        object.__setattr__(self, "digest", digest)

    @property
    def network(self) -> Network:
        """The network, loaded once in a process."""
        return _network(self.path, self.digest)

    @property
    def least_scores(self) -> FloatArray:
        """(C,) least scores of the network's classes.

        Raises:
            ConfigError: `least_score` is of another number of classes.
        """
        own = self.network.least_score
        if self.least_score is None:
            return own
        if isinstance(self.least_score, tuple) and len(self.least_score) != len(own):
            raise ConfigError(f"least_score: {len(self.least_score)} scores for {len(own)} classes")
        return np.broadcast_to(np.array(self.least_score, dtype=np.float64), own.shape)


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A loaded network.

    Args:
        session: of onnxruntime.
        decoder: makes boxes of its output.
        score_scale: (C,) factor of the logits of each class's scores, by which they are calibrated.
        score_offset: (C,) added to them.
        least_score: (C,) of boxes of each class that count, in [0, 1]: at which F1 is greatest on frames that
            were held out from the training, or `LEAST_SCORE`.
        origin: what the file says of how it was made.
    """

    session: Any
    decoder: Decoder
    score_scale: NDArray[np.float32]
    score_offset: NDArray[np.float32]
    least_score: FloatArray
    origin: dict[str, Any]

    @property
    def grid(self) -> PillarGrid:
        """Cells that clouds are put into."""
        return self.decoder.grid

    def run(self, seen: Pillars) -> NDArray[np.float32]:
        """(C, R, L) output for one cloud's pillars, with calibrated scores; see `Decoder`.

        Raises:
            ConfigError: the network does not run on the pillars, or says something of another shape.
        """
        given = dict(zip(INPUTS, (seen.features, seen.cell), strict=True))
        try:
            output: NDArray[np.float32] = np.asarray(self.session.run([OUTPUT], given)[0])
        except Exception as error:  # onnxruntime's errors have no common base
            raise ConfigError(f"network: cannot run: {_first_line(error)}") from None
        if output.shape != (1, *self.decoder.shape):
            raise ConfigError(
                f"network: expected an output of shape {(1, *self.decoder.shape)}, got {output.shape}"
            )
        output = output[0]
        classes = len(self.score_scale)
        output[:classes] *= self.score_scale[:, None, None]
        output[:classes] += self.score_offset[:, None, None]
        return output


def metadata(
    decoder: Decoder,
    score_scale: list[float],
    score_offset: list[float],
    least_score: list[float],
    origin: dict[str, Any],
) -> str:
    """The text that a file carries about itself."""
    content = {
        "version": VERSION,
        "grid": asdict(decoder.grid),
        "classes": list(decoder.classes),
        "overlap": decoder.overlap,
        "score_scale": score_scale,
        "score_offset": score_offset,
        "least_score": least_score,
        "origin": origin,
    }
    return json.dumps(content, sort_keys=True)


def _content(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        if size > LARGEST_BYTES:
            raise ConfigError(f"{path}: {size} bytes; networks have at most {LARGEST_BYTES}")
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None


@lru_cache(maxsize=4)
def _network(path: Path, digest: str) -> Network:
    try:
        import onnxruntime
    except ImportError as error:
        raise ConfigError(_smartmot.missing_extra("learned detectors", "lidar", error)) from None
    content = _content(path)
    if hashlib.sha256(content).hexdigest() != digest:
        raise ConfigError(f"{path}: has changed while it was used")
    if EXTERNAL in content:
        raise ConfigError(
            f"{path}: has its weights in another file, which its SHA-256 does not cover; write them into one "
            "(onnx.save, save_as_external_data=False)"
        )
    options = onnxruntime.SessionOptions()
    # one run is one thread: several runs share the processor, and results do not depend on it
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no common base
        raise ConfigError(f"{path}: is no network that onnxruntime can run: {_first_line(error)}") from None
    described = session.get_modelmeta().custom_metadata_map.get(METADATA)
    names = tuple(entry.name for entry in session.get_inputs())
    if described is None or names != INPUTS or OUTPUT not in {entry.name for entry in session.get_outputs()}:
        raise ConfigError(
            f"{path}: says nothing of grid and classes; another detector's network needs an adapter, "
            "see docs/learned.md"
        )
    return _described(path, session, described)


def _described(path: Path, session: Any, text: str) -> Network:
    try:
        content = json.loads(text)
        if content["version"] != VERSION:
            raise ConfigError(f"{path}: is of version {content['version']}, this program reads {VERSION}")
        pairs = content["grid"].items()
        fields: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in pairs}
        grid = PillarGrid(**fields)
        classes = tuple(content["classes"])
        scale, offset = (
            np.array(content[name], dtype=np.float32) for name in ("score_scale", "score_offset")
        )
        least = np.array(content.get("least_score", [LEAST_SCORE] * len(classes)), dtype=np.float64)
        overlap = float(content["overlap"])
        origin = dict(content["origin"])
        is_known = bool(classes) and set(classes) <= set(CATEGORIES) and len(set(classes)) == len(classes)
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{path}: its metadata is damaged: {_first_line(error)}") from None
    if type(grid.most_points) is not int or not 0.0 <= overlap <= 1.0:
        raise ConfigError(
            f"{path}: its metadata is damaged: most_points must be a whole number and overlap lie in [0, 1]; "
            f"got {grid.most_points!r} and {overlap:g}"
        )
    finite = np.isfinite(scale).all() and np.isfinite(offset).all()
    if not is_known or {scale.shape, offset.shape} != {(len(classes),)} or not finite:
        raise ConfigError(
            f"{path}: its classes must be some of {', '.join(CATEGORIES)}, each once and with a finite scale "
            f"and offset; got {classes}"
        )
    if least.shape != (len(classes),) or not ((least >= 0.0) & (least <= 1.0)).all():
        raise ConfigError(
            f"{path}: its metadata is damaged: least_score must be a number in [0, 1] for each of {classes}; "
            f"got {least.tolist()}"
        )
    decoder = Decoder(grid, classes, overlap=overlap)
    _require_shapes(path, session, decoder)
    return Network(session, decoder, scale, offset, least, origin)


def _require_shapes(path: Path, session: Any, decoder: Decoder) -> None:
    """See that a network takes pillars of its grid and has an output of its cells; names stand for any size.

    Raises:
        ConfigError: it does not.
    """
    (output,) = (entry for entry in session.get_outputs() if entry.name == OUTPUT)
    shapes = ((None, decoder.grid.most_points, len(FEATURES)), (None,), (1, *decoder.shape))
    entries = zip((*session.get_inputs(), output), shapes, (*INPUT_TYPES, INPUT_TYPES[0]), strict=True)
    for entry, shape, kind in entries:
        same = len(entry.shape) == len(shape) and all(
            not isinstance(got, int) if wanted is None else got == wanted or not isinstance(got, int)
            for got, wanted in zip(entry.shape, shape, strict=True)
        )
        if not same or entry.type != kind:
            expected = ", ".join("N" if wanted is None else str(wanted) for wanted in shape)
            raise ConfigError(
                f"{path}: {entry.name}: expected {kind} of shape ({expected}) by its metadata, "
                f"got {entry.type} of {entry.shape}"
            )


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
