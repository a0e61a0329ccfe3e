"""The files of a model of one's own: the model, what it includes, its meshes and images.

They are found by the names in the text, and read before MuJoCo sees any of them. MuJoCo is given their content, so
it opens no file, and the model stays the same however often it is compiled.
"""

from __future__ import annotations

import html
import json
import os
import posixpath  # MuJoCo's names have slashes everywhere
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tunnel_sim.files.reading import check_count, decoded, read_regular, read_text
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, one_line, shown

if TYPE_CHECKING:
    import mujoco

_VALUE = r"\s*=\s*(\"[^\"]*\"|'[^']*')"
_DOCUMENT = re.compile(r"<(?:include|model)\s[^<>]*?\bfile" + _VALUE)
_FILE = re.compile(r"\bfile(?:name|up|down|left|right|front|back)?" + _VALUE)
_FOLDER = re.compile(r"\b(?:asset|mesh|texture)dir" + _VALUE)
_STRIPPED = re.compile(
    r"<robot\b|\bstrippath\s*=\s*[\"']true"
)  # MuJoCo takes the last part of a URDF's names
_MOST_FOLDERS = 20  # of a model: each name is looked for in each
_SMALLER = "leave out what the motion of the joint does not need"


@dataclass(frozen=True)
class ModelFiles:
    """The content of a model's files.

    Args:
        text: of the model, MJCF or URDF.
        documents: further XML, by the name under which MuJoCo asks for it.
        assets: meshes, height fields and images, by such names.
    """

    text: str
    documents: Mapping[str, bytes]
    assets: Mapping[str, bytes]

    def spec(self) -> mujoco.MjSpec:
        """The model's specification, read again.

        Raises:
            TunnelError: when MuJoCo refuses it.
        """
        import mujoco  # only here: slow to load, and the limited process has it

        from tunnel_sim.engine.model import load_plugin

        load_plugin()
        with engine_refusals("MuJoCo cannot load it", "correct the file"):
            return mujoco.MjSpec.from_string(self.text, include=self.documents, assets=dict(self.assets))

    def to_bytes(self) -> bytes:
        """The sizes in one line of JSON, then the contents."""
        parts = [{"": self.text.encode()}, self.documents, self.assets]
        sizes = [{name: len(content) for name, content in part.items()} for part in parts]
        contents = [content for part in parts for content in part.values()]
        return b"".join([json.dumps(sizes).encode(), b"\n", *contents])

    @classmethod
    def from_bytes(cls, content: bytes) -> ModelFiles:
        """The files of `to_bytes`."""
        at = content.index(b"\n") + 1
        parts: list[dict[str, bytes]] = []
        for sizes in json.loads(content[:at]):
            parts.append({})
            for name, size in sizes.items():
                parts[-1][name] = content[at : at + size]
                at += size
        return cls(parts[0][""].decode(), parts[1], parts[2])


def read_model_files(path: Path, asset_dir: Path | None = None) -> ModelFiles:
    """Read a model and the files that it names.

    Args:
        path: of the model, MJCF or URDF.
        asset_dir: a further folder in which its files may be, beside the model's own.

    Raises:
        TunnelError: when a file is elsewhere, not a regular one, too large or not UTF-8, or there are too many.
    """
    text = read_text(path, limits.MODEL_BYTES, missing="name an MJCF or URDF file")
    reader = _Reader(path, asset_dir)
    left = [("", text)]
    while left:
        left += reader.read_documents(*left.pop())
    reader.read_assets()
    return ModelFiles(text, reader.documents, reader.assets)


class _Reader:
    """What is found of a model's files."""

    def __init__(self, path: Path, asset_dir: Path | None) -> None:
        self._path = path
        self._roots = [Path(os.path.realpath(one)) for one in (path.parent, asset_dir) if one is not None]
        self._folders = {""}
        self._names: dict[
            tuple[str, str], None
        ] = {}  # of meshes and images, with the folder of their document
        self._stripped = False
        self.documents: dict[str, bytes] = {}
        self.assets: dict[str, bytes] = {}

    def read_documents(self, folder: str, text: str) -> Iterator[tuple[str, str]]:
        """Read what a document includes, and note what else it names.

        Args:
            folder: of the document, in that of the model.

        Yields:
            Folder and text of each further document.
        """
        text = "".join(_outside_comments(text))
        self._folders.update(_values(_FOLDER, text))
        self._stripped |= _STRIPPED.search(text) is not None
        inner = _values(_DOCUMENT, text)
        self._names |= dict.fromkeys((folder, name) for name in _values(_FILE, text) if name not in inner)
        self._check_count(len(self._names) + len(self.documents) + len(inner))
        for name in inner:
            for place in _places(name, ("", folder), ("",)):
                content = None if place in self.documents else self._content(place, limits.MODEL_BYTES)
                if content is not None:
                    self.documents[place] = content
                    self._check_size(self.documents, limits.MODEL_BYTES, "bytes of XML")
                    yield posixpath.dirname(place), decoded(content, shown(self._path.parent / place))

    def read_assets(self) -> None:
        """Read the meshes and images."""
        if len(self._folders) > _MOST_FOLDERS:
            raise TunnelError(
                f"names {len(self._folders) - 1} folders", where=shown(self._path), remedy="use one meshdir"
            )
        missing = []
        for folder, name in self._names:
            names = (name, posixpath.basename(name)) if self._stripped else (name,)
            places = {place: None for one in names for place in _places(one, ("", folder), self._folders)}
            known = len(self.assets)
            for place in places.keys() - self.assets.keys():
                content = self._content(place, limits.ASSET_BYTES)
                if content is not None:
                    self.assets[place] = content
                    self._check_size(self.assets, limits.ASSET_BYTES, "bytes of meshes and images")
            if len(self.assets) == known and not places.keys() & self.assets.keys():
                missing.append(name)
        # MuJoCo would take a file of the same name from another folder in its place.
        taken = {posixpath.basename(place).lower() for place in self.assets}
        for name in missing:
            if posixpath.basename(name).lower() in taken:
                where = shown(self._path)
                raise TunnelError(
                    f"names {one_line(name)!r}, which is not there", where=where, remedy="check the path"
                )

    def _content(self, place: str, limit: int) -> bytes | None:
        """The content of a file; None where there is none."""
        path = self._path.parent / place
        try:
            if not os.path.lexists(path):
                return None
            real = Path(os.path.realpath(path))
        except ValueError:
            return None
        if path.is_dir():  # a name that is put together from a folder of other files
            return None
        if not any(real.is_relative_to(root) for root in self._roots):
            raise TunnelError(
                f"names {one_line(place)!r}, which is outside the model's folder",
                where=shown(self._path),
                remedy="move it there, or name its folder with --asset-dir",
            )
        return read_regular(path, limit)

    def _check_count(self, count: int) -> None:
        check_count(count, limits.MODEL_FILES, "names of files", shown(self._path), _SMALLER)

    def _check_size(self, files: Mapping[str, bytes], limit: int, what: str) -> None:
        check_count(sum(map(len, files.values())), limit, what, shown(self._path), _SMALLER)


def _places(name: str, bases: Sequence[str], folders: Iterable[str]) -> list[str]:
    """Where a file may be, as MuJoCo would name it from the model's folder."""
    name = name.replace("\\", "/")
    found = (posixpath.join(base, folder, name) for base in bases for folder in folders)
    return list(dict.fromkeys(posixpath.normpath(one) for one in found))


def _values(pattern: re.Pattern[str], text: str) -> set[str]:
    """The values of an attribute, those that are empty left out."""
    return {html.unescape(found[1][1:-1]) for found in pattern.finditer(text)} - {""}


def _outside_comments(text: str) -> Iterator[str]:
    first, *others = text.split("<!--")
    yield first
    for one in others:
        yield one.partition("-->")[2]


@contextmanager
def engine_refusals(what: str, remedy: str, where: str = "") -> Iterator[None]:
    """Convert what MuJoCo raises for a model; its warnings are left out.

    Raises:
        TunnelError: instead of it.
    """
    import mujoco

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        said = one_line(" ".join(str(error).split()), 300)
        if isinstance(error, MemoryError) or "unknown exception" in said:  # std::bad_alloc, std::length_error
            said = "not enough memory, or a size out of range"
        raise TunnelError(f"{what} ({said})", where=where, remedy=remedy) from error
