"""The files of a user's model, MJCF or URDF.

They are found by the names in the text, and read before MuJoCo sees any of them. MuJoCo receives their content,
so it opens no file, and the model is the same at every compilation.
"""

from __future__ import annotations

import html
import os
import posixpath  # MuJoCo's names have slashes everywhere
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco

from tunnel_sim.engine.model import load_plugin
from tunnel_sim.files.reading import check_count, decoded, read_regular, read_text
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, one_line, shown

_VALUE = r"\s*=\s*(\"[^\"]*\"|'[^']*')"
_DOCUMENT = re.compile(r"<(?:include|model)\s[^<>]*?\bfile" + _VALUE)
_FILE = re.compile(r"\bfile(?:name|up|down|left|right|front|back)?" + _VALUE)
_FOLDER = re.compile(r"\b(?:asset|mesh|texture)dir" + _VALUE)
_STRIPPED = re.compile(r"<robot\b|\bstrippath\s*=\s*[\"']true")  # MuJoCo uses the last part of a URDF's names
_MOST_FOLDERS = 20  # maximum number of folders of a model: each name is looked for in each
_SMALLER = "leave out what the motion of the joint does not need"


@dataclass(frozen=True)
class ModelFiles:
    """The content of a model's files: its MJCF or URDF, and further XML and assets by MuJoCo's name for them."""

    text: str
    documents: Mapping[str, bytes]
    assets: Mapping[str, bytes]

    def spec(self) -> mujoco.MjSpec:
        """The model's specification, read again."""
        load_plugin()
        with engine_refusals("MuJoCo cannot load it", "correct the file"):
            return mujoco.MjSpec.from_string(self.text, include=self.documents, assets=dict(self.assets))

    def to_parts(self) -> tuple[dict[str, list[str]], list[bytes]]:
        """The names of documents and assets, and the contents of the model, the documents and the assets."""
        names = {"documents": [*self.documents], "assets": [*self.assets]}
        return names, [self.text.encode(), *self.documents.values(), *self.assets.values()]

    @classmethod
    def from_parts(cls, names: Mapping[str, Sequence[str]], parts: Sequence[bytes]) -> ModelFiles:
        """The files from the result of `to_parts`."""
        text, *contents = parts
        count = len(names["documents"])
        documents = dict(zip(names["documents"], contents[:count], strict=True))
        return cls(text.decode(), documents, dict(zip(names["assets"], contents[count:], strict=True)))


def read_model_files(path: Path, asset_dir: Path | None = None) -> ModelFiles:
    """Read a model and the files that it names, from its own folder or a further one."""
    text, where = read_text(path, limits.MODEL_BYTES, missing="name an MJCF or URDF file"), shown(path)
    folders, stripped = {""}, False
    names: dict[tuple[str, str], None] = {}  # folders of meshes and images, relative to their document
    documents: dict[str, bytes] = {}
    assets: dict[str, bytes] = {}
    unread = [("", text)]
    while unread:
        folder, document = unread.pop()
        first, *others = document.split("<!--")
        document = first + "".join(one.partition("-->")[2] for one in others)
        folders.update(_values(_FOLDER, document))
        stripped |= _STRIPPED.search(document) is not None
        inner = _values(_DOCUMENT, document)
        names |= dict.fromkeys((folder, name) for name in _values(_FILE, document) if name not in inner)
        count = len(names) + len(documents) + len(inner)
        check_count(count, limits.MODEL_FILES, "names of files", where, _SMALLER)
        for place in (place for name in inner for place in _places(name, ("", folder), ("",))):
            content = None if place in documents else _content(path, asset_dir, place, limits.MODEL_BYTES)
            if content is not None:
                documents[place] = content
                size = sum(map(len, documents.values()))
                check_count(size, limits.MODEL_BYTES, "bytes of XML", where, _SMALLER)
                unread.append((posixpath.dirname(place), decoded(content, shown(path.parent / place))))
    if len(folders) > _MOST_FOLDERS:
        raise TunnelError(f"names {len(folders) - 1} folders", where=where, remedy="use one meshdir")
    missing = []
    for folder, name in names:
        own = (name, posixpath.basename(name)) if stripped else (name,)
        places = {place: None for one in own for place in _places(one, ("", folder), folders)}
        for place in places.keys() - assets.keys():
            content = _content(path, asset_dir, place, limits.ASSET_BYTES)
            if content is not None:
                assets[place] = content
                size = sum(map(len, assets.values()))
                check_count(size, limits.ASSET_BYTES, "bytes of meshes and images", where, _SMALLER)
        if not places.keys() & assets.keys():
            missing.append(name)
    # Otherwise MuJoCo would use a file of the same name from another folder.
    taken = {posixpath.basename(place).lower() for place in assets}
    for name in missing:
        if posixpath.basename(name).lower() in taken:
            what = f"names {one_line(name)!r}, which is not there"
            raise TunnelError(what, where=where, remedy="check the path")
    return ModelFiles(text, documents, assets)


def _content(model: Path, asset_dir: Path | None, place: str, limit: int) -> bytes | None:
    """The content of a file of a model; None if it does not exist."""
    path = model.parent / place
    try:
        if not os.path.lexists(path):
            return None
        real = Path(os.path.realpath(path))
    except ValueError:
        return None
    if path.is_dir():  # a name composed from a folder of other files
        return None
    roots = [Path(os.path.realpath(one)) for one in (model.parent, asset_dir) if one is not None]
    if not any(real.is_relative_to(root) for root in roots):
        what = f"names {one_line(place)!r}, which is outside the model's folder"
        remedy = "move it there, or name its folder with --asset-dir"
        raise TunnelError(what, where=shown(model), remedy=remedy)
    return read_regular(path, limit)


def _places(name: str, bases: Sequence[str], folders: Iterable[str]) -> list[str]:
    """Possible paths of a file, given its name in MuJoCo relative to the model's folder."""
    name = name.replace("\\", "/")
    found = (posixpath.join(base, folder, name) for base in bases for folder in folders)
    return list(dict.fromkeys(posixpath.normpath(one) for one in found))


def _values(pattern: re.Pattern[str], text: str) -> set[str]:
    """The values of an attribute, without empty values."""
    return {html.unescape(found[1][1:-1]) for found in pattern.finditer(text)} - {""}


@contextmanager
def engine_refusals(what: str, remedy: str, where: str = "") -> Iterator[None]:
    """Convert MuJoCo's exceptions for a model; its warnings are omitted."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        said = one_line(" ".join(str(error).split()), 300)
        if isinstance(error, MemoryError) or "unknown exception" in said:  # std::bad_alloc, std::length_error
            said = "not enough memory, or a size out of range"
        raise TunnelError(f"{what} ({said})", where=where, remedy=remedy) from error
