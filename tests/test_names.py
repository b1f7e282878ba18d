"""Names say what they hold, within a budget: CONTRIBUTING.md says why."""

import ast
import functools
import re
from collections import Counter, defaultdict
from collections.abc import Iterator

import pytest

from .rooms import MODULES
from .test_architecture import nodes

VAGUE = re.findall(
    r"\w+",
    "told held seen said found given made here there own other others one two more some both each "
    "every few many known wanted lost kept less worst moved inside whole rest part parts place "
    "places way ways words sound left right apart level shown taken these those",
)
"""Words that say nothing of what a variable, an argument or a loop's name holds."""
QUESTIONS = frozenset({"what", "how", "whether", "where", "which", "as", "that"})
DIALECT = re.findall(
    r"\w+",
    "told tell tells sought seek seeks foretold foretell foretells beforehand anew beside untold "
    "mend mended amiss",
)
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def bindings() -> Iterator[str]:
    for _, node in nodes():
        if isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def docstrings() -> Iterator[tuple[str, list[str]]]:
    for module, node in nodes():
        if isinstance(node, DOCUMENTED) and (text := ast.get_docstring(node)):
            yield module, text.split()


def test_bindings_say_what_they_hold():
    counts = Counter(bindings())
    vague = {name: counts[name] for name in VAGUE if counts[name]}
    share = sum(vague.values()) / counts.total()
    assert share <= 0.02, sorted(vague.items(), key=lambda item: -item[1])[:10]


def test_no_class_name_stands_twice():
    modules = defaultdict(set)
    for module, node in nodes():
        if isinstance(node, ast.ClassDef):
            modules[node.name.lstrip("_")].add(module)
    assert not {name: where for name, where in modules.items() if len(where) > 1}


def test_docstrings_open_with_a_noun_or_a_verb():
    openings = [(module, words[0].lower().strip(",.:")) for module, words in docstrings()]
    questions = [(module, word) for module, word in openings if word in QUESTIONS]
    assert len(questions) <= 0.02 * len(openings), questions[:10]


@functools.cache
def words_of_texts() -> list[tuple[str, frozenset[str]]]:
    """Words of each docstring of the packages, and of each benchmark as a whole."""
    texts = [(module, " ".join(words)) for module, words in docstrings()]
    texts += [
        (module, path.read_text(encoding="utf-8"))
        for module, path in MODULES.items()
        if module.startswith("benchmarks.")
    ]
    return [(module, frozenset(re.findall(r"\w+", text.lower()))) for module, text in texts]


@pytest.mark.parametrize("word", sorted(DIALECT))
def test_texts_are_in_plain_words(word: str):
    texts = [module for module, words in words_of_texts() if word in words]
    assert len(texts) <= 2, f"{word!r} (CONTRIBUTING.md has the usual word): {texts}"
