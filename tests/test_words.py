"""The prose of the package: the terms of the field, sentences with a subject, and names that are nouns or verbs.

Each figure has a limit that may only be lowered. `python3 tests/test_words.py RULE` lists the places that a rule finds.
"""

import ast
import collections
import io
import re
import sys
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]

COINED = {  # pattern: term of the field
    r"foret(?:ell|old)\w*|foreseen?|foresight": "predict, predicted",
    r"let(?:s|ting)? go\b": "separate, open, release",
    r"giv(?:es?|ing) way": "deform, yield",
    r"\bat rest\b": "in the reference configuration, or in equilibrium",
    r"\bfoot\b": "outer edge of the regularisation",
    r"\bwhat is driven\b|\bdriven thing\b": "controlled load, control parameter",
    r"\bthings?\b": "loads, supports, contacts",
    r"\bown (?:part|rows|points)\b": "locally owned entries",
    r"\btake[ns]? (?:up|over)\b": "update, transfer",
    r"\bgo(?:es|ne|ing)? on (?:with|from)\b": "continue, resume",
    r"\bc(?:omes?|ame) to\b": "reach, equal, converge to",
    r"\bgood as (?:none|nothing|that)\b": "negligible",
    r"\bso many\b|\bby (?:so|how) much\b": "n, the amount",
    r"\bin words\b": "as text",
    r"\bround bod(?:y|ies)\b": "axisymmetric body",
    r"\bin space\b": "in three dimensions",
    r"\bleast\b(?! (?:a|one|two|squares|as|of all))": "minimum",
    r"\bverdicts?\b|\bdoubt(?:s|ed)?\b|\balarms?\b": "check, warning, instability",
}
PARTICLES = (r"who|told|soon|by|off|one|more|none|rough|here|there|gives|lets|comes|wanted|stand|standing|things?|worn|"
             r"foret\w*|_?foreseen|taken_over|take_over|doubts\w*|_?bears|_?sunk|_lets\w*")
"""Names that are prepositions, pronouns, adverbs or coined words."""

RULES = {
    "free_relative": r"\b(?:what|whatever)\s+(?!if\b|to\b)\w+",
    "that_of": r"\bth(?:at|ose) (?:of|that|which)\b",
    "coined": "|".join(COINED),
}
NO_SUBJECT = (r"(?:Of|What|Whatever|That|Those|By|At|In|From|As|To|Which|Whether|How|Where|When|Not|Also|Else|Why)\b")
LIMITS = {"free_relative": 0.1, "that_of": 0.13, "coined": 0.29, "long": 0.65, "no_subject": 0.01, "particles": 0.21}
"""Per 1000 words; per cent of sentences above 30 words; of docstrings; of names."""


def prose(text):
    """Text without code, tables, formulas, headings and directives."""
    text = re.sub(r"```.*?```|\$\$.*?\$\$", " ", text, flags=re.S)
    text = re.sub(r"(?m)^\s*\.\. math::.*?(?=^\s*$|\Z)", " ", text, flags=re.S | re.M)
    lines = [line for line in text.splitlines() if not re.match(r"\s*(>>>|\.\.\.? |\||#|:\w+:)", line)]
    return re.sub(r":math:`[^`]*`|`[^`]*`|\$[^$]*\$|\]\([^)]*\)", " X ", "\n".join(lines))


def sentences(text):
    """Sentences of more than three words, with their lengths."""
    for paragraph in re.split(r"\n\s*\n", prose(text)):
        for sentence in re.split(r"(?<=[.?!])\s+|(?<=[;:])\s+(?=[A-Z])", " ".join(paragraph.split())):
            if (length := len(re.findall(r"[A-Za-z][\w'-]*", sentence))) > 3:
                yield sentence, length


def texts():
    """(place, kind, text) of every page, docstring and comment."""
    for page in PAGES:
        yield str(page.relative_to(ROOT)), "page", page.read_text()
    for file in sorted((ROOT / "formingx").rglob("*.py")):
        source, place = file.read_text(), str(file.relative_to(ROOT))
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
                yield f"{place}:{getattr(node, 'lineno', 1)}", "docstring", text
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type == tokenize.COMMENT:
                yield f"{place}:{token.start[0]}", "comment", token.string.lstrip("# ")
            elif token.type == tokenize.NAME:
                yield f"{place}:{token.start[0]}", "name", token.string


def measured():
    """Figures of all rules, and the places that each rule finds."""
    found, count = collections.defaultdict(list), collections.Counter()
    for place, kind, text in texts():
        count[kind] += 1
        if kind == "name":
            if re.fullmatch(PARTICLES, text):
                found["particles"].append(f"{place}: {text}")
            continue
        if kind == "docstring" and re.match(NO_SUBJECT, text):
            found["no_subject"].append(f"{place}: {text.splitlines()[0]}")
        for sentence, length in sentences(text):
            count.update(words=length, sentences=1)
            for rule, pattern in RULES.items():
                found[rule] += [f"{place}: {m.group()} | {sentence}" for m in re.finditer(pattern, sentence, re.I)]
            if length > 30:
                found["long"].append(f"{place}: {length} words | {sentence}")
    whole = dict.fromkeys(RULES, count["words"] / 1000) | {
        "long": count["sentences"] / 100, "no_subject": count["docstring"] / 100, "particles": count["name"] / 100}
    return {rule: len(found[rule]) / whole[rule] for rule in LIMITS}, found


@pytest.fixture(scope="module")
def figures():
    return measured()[0]


@pytest.mark.parametrize("rule", LIMITS)
def test_words(rule, figures):
    assert figures[rule] <= LIMITS[rule], f"python3 tests/test_words.py {rule} lists the places"


if __name__ == "__main__":
    values, places = measured()
    for rule in sys.argv[1:]:
        print(*places[rule], sep="\n")
    if not sys.argv[1:]:
        for rule, value in values.items():
            print(f"{rule:14}{value:7.2f}   limit {LIMITS[rule]:6.2f}   {len(places[rule])} places")
