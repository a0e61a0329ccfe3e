"""Functions take few parameters: many options are the fields of a value."""

from __future__ import annotations

import ast

from tests.support.sources import modules, parsed

MOST = 8
KEYWORDS_ARE_A_CONTRACT = {
    "tunnel_lab.envs.campaign.__init__",  # keywords of gymnasium.make
}
"""Public verbs whose many keywords users write."""


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    given = function.args
    names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def test_no_function_has_more_than_eight_parameters_but_public_verbs() -> None:
    counts = {
        f"{module}.{node.name}": parameters(node)
        for module, path in modules().items()
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert len(counts) > 3000
    assert {name for name, count in counts.items() if count > MOST} == KEYWORDS_ARE_A_CONTRACT
