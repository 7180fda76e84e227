"""Reading an SMT-LIB 2 file of obligations: only what such a file may hold, everything else is refused.

    file   ::= comment* (set-logic QF_UF) block*
    block  ::= comment (push 1) (echo "NAME") declaration* definition* assertion+ (check-sat) (pop 1)
    declaration ::= (declare-const |VARIABLE| Bool)
    definition  ::= (define-fun WORD () Bool term)
    assertion   ::= (assert term)
    term   ::= |VARIABLE| | WORD | true | false | (not term) | (and term term+) | (or term term+) | (= term term)

where no operand of an `and` or an `or` stands there twice or is a constant, and none of a `not` is one or a `not`. Each
command has a line; a term that is longer than a line has a line for each operand, indented by its depth. Variables are
declared in the order in which they first stand in what is asserted, definitions written out; these are numbered from 1,
in their order.

What a solver is asked could be bent by a command in between: an option, an assertion outside of the blocks, a variable
that is declared and then defined. So the reader knows no other command, a word is one that the block has defined
before, a variable one that it has declared, and each of them is used. What remains is what the terms say.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from firable.decompose.verification.formulas import FALSE, TRUE, Formula, Formulas

_TOKEN: Final = re.compile(r"""(\s*)(\(|\)|\|[^|\\]*\||"[^"]*"|;[^\n]*|[^\s()|";]+)""")
_LINE_MAX: Final = 110
"""The characters of a term on one line."""
_WORD: Final = re.compile(r"shared_*([1-9][0-9]*)")


class ReadingError(Exception):
    """The text is no file of obligations, and why."""


@dataclass(frozen=True, slots=True)
class Block:
    """One obligation of a file: its name, the sentence above it, and what is asserted."""

    name: str
    sentence: str
    asserted: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class ObligationFile:
    """A file: the comments at its head, and its blocks."""

    head: tuple[str, ...]
    blocks: tuple[Block, ...]


def read_file(text: str, formulas: Formulas) -> ObligationFile:
    """Read a file; raises `ReadingError` for whatever is none.

    >>> text = "; so\\n(set-logic QF_UF)\\n\\n; it is\\n(push 1)\\n(echo \\"a\\")\\n(declare-const |p| Bool)\\n"
    >>> text += "(assert (not |p|))\\n(check-sat)\\n(pop 1)\\n"
    >>> of = Formulas()
    >>> read_file(text, of).blocks == (Block("a", "it is", (of.literal("p", False),)),)
    True
    """
    return _Reader(text, formulas).file()


class _Term:
    """A term that is being read, and how it stands there: on one line, or with a line for each operand."""

    def __init__(self, operator: str, begins_line: bool) -> None:
        self.operator, self.begins_line = operator, begins_line
        self.operands: list[Formula] = []
        self.length = len("(") + len(operator)  # on one line
        self.breaks: set[bool] = set()  # whether operands begin a line

    def take(self, value: Formula, length: int, *, begins_line: bool) -> None:
        self.operands.append(value)
        self.length += len(" ") + length
        self.breaks.add(begins_line)

    def ended(self) -> int:
        """Its length on one line; raises `ReadingError` where it has more and needs not, or needs more and has not."""
        length = self.length + len(")")
        if self.breaks != {length > _LINE_MAX}:
            raise ReadingError(f"the lines of '{self.operator}' are not as they are written")
        return length


class _Reader:
    def __init__(self, text: str, formulas: Formulas) -> None:
        self.formulas = formulas
        self.broken: list[bool] = []  # whether each token begins a line
        self.tokens = list(self._tokens(text))
        self.tokens.append("")  # behind the last
        self.broken.append(False)
        self.position = 0

    def _tokens(self, text: str) -> Iterator[str]:
        position, depth, before = 0, 0, ""
        end = len(text.removesuffix("\n"))
        while position < end:
            found = _TOKEN.match(text, position)
            if found is None or not _is_laid_out(before, found[1], found[2], depth):
                raise ReadingError(f"nothing may be written as {text[position : position + 20]!r}")
            self.broken.append(found[1].startswith("\n"))
            before = found[2]
            depth += {"(": 1, ")": -1}.get(before, 0)
            yield before
            position = found.end()
        if position != len(text) - 1:
            raise ReadingError("the last line has an end, and nothing is behind it")

    def next(self) -> str:
        token = self.tokens[self.position]
        self.position += bool(token)  # nothing is behind the end
        return token

    def expect(self, *tokens: str) -> None:
        for token in tokens:
            if (found := self.next()) != token:
                raise ReadingError(f"expected {token!r}, found {found!r}" if found else f"cut off before {token!r}")

    def comments(self) -> Iterator[str]:
        while self.tokens[self.position].startswith(";"):
            yield self.next().removeprefix(";").removeprefix(" ")

    def file(self) -> ObligationFile:
        head = tuple(self.comments())
        self.expect("(", "set-logic", "QF_UF", ")")
        blocks = []
        while self.tokens[self.position]:
            blocks.append(self.block())
        return ObligationFile(head, tuple(blocks))

    def block(self) -> Block:
        sentences = tuple(self.comments())
        if len(sentences) != 1:
            raise ReadingError("each obligation has one sentence above it")
        self.expect("(", "push", "1", ")", "(", "echo")
        name = self.next()
        if not name.startswith('"'):
            raise ReadingError(f"the name of an obligation stands in quotes, not as {name!r}")
        self.expect(")")
        declared: dict[str, Formula] = {}
        defined: dict[str, Formula] = {}
        names: dict[str, list[str]] = {"": []}  # what stands in each definition, and in what is asserted
        asserted: list[Formula] = []
        while True:
            self.expect("(")
            match self.next():
                case "declare-const" if not defined and not asserted:
                    symbol = self.next()
                    if symbol in declared or not symbol.startswith("|"):
                        raise ReadingError(f"{symbol} cannot be declared here")
                    self.expect("Bool", ")")
                    declared[symbol] = self.formulas.symbol(symbol[1:-1])
                case "define-fun" if not asserted:
                    word = self.next()
                    numbered = _WORD.fullmatch(word)
                    taken = word in defined or f"|{word}|" in declared
                    if taken or numbered is None or int(numbered[1]) != len(defined) + 1:
                        raise ReadingError(f"{word} cannot be defined here")
                    self.expect("(", ")", "Bool")
                    value = self.term(declared, defined, names.setdefault(word, []))
                    self.expect(")")
                    defined[word] = value
                case "assert":
                    asserted.append(self.term(declared, defined, names[""]))
                    self.expect(")")
                case "check-sat" if asserted:
                    self.expect(")", "(", "pop", "1", ")")
                    break
                case other:
                    raise ReadingError(f"'{other}' may not stand here")
        used = _in_order(names)
        if unused := sorted({*declared, *defined}.difference(used)):
            raise ReadingError(f"{unused[0]} is of no use")
        if list(declared) != [name for name in used if name in declared]:
            raise ReadingError("the variables are declared in another order than that in which they stand")
        return Block(name[1:-1], sentences[0], tuple(asserted))

    def term(self, declared: dict[str, Formula], defined: dict[str, Formula], names: list[str]) -> Formula:
        stack: list[_Term] = []
        while True:
            begins_line, token = self.broken[self.position], self.next()
            if token == "(":
                stack.append(_Term(self.next(), begins_line))
                continue
            length = len(token)
            if token == ")" and stack:
                ended = stack.pop()
                value, begins_line = self._applied(ended.operator, ended.operands), ended.begins_line
                length = ended.ended()
            elif token in declared:
                names.append(token)
                value = declared[token]
            elif token in defined:
                names.append(token)
                value = defined[token]
            elif token in ("true", "false"):
                value = TRUE if token == "true" else FALSE
            else:
                raise ReadingError(f"{token!r} is nothing that was declared")
            if not stack:
                return value
            stack[-1].take(value, length, begins_line=begins_line)

    def _applied(self, operator: str, operands: list[Formula]) -> Formula:
        match operator, len(operands):
            case "not", 1 if operands[0] not in (TRUE, FALSE) and not self.formulas.is_negation(operands[0]):
                return self.formulas.negation(operands[0])
            case "and" | "or", n if n > 1 and len({*operands, TRUE, FALSE}) == n + 2:
                return self.formulas.all_of(operands) if operator == "and" else self.formulas.any_of(operands)
            case "=", 2:
                return self.formulas.equal(*operands)
        raise ReadingError(f"nobody writes '{operator}' of these {len(operands)} operands")


def _is_laid_out(before: str, blank: str, token: str, depth: int) -> bool:
    """Whether there is what has to be between two words: a blank, or a line with its indentation, and nothing else."""
    if not before:
        return not blank
    if depth == 0:  # a line for each command, and an empty one before the sentence of a block
        return blank == ("\n\n" if token.startswith(";") and not before.startswith(";") else "\n")
    if before == "(" or token == ")":
        return not blank
    return blank == " " or (depth > 1 and blank == "\n" + "  " * (depth - 1))


def _in_order(names: dict[str, list[str]]) -> list[str]:
    """What stands in what is asserted, definitions written out where they first stand, each once."""
    found: dict[str, None] = {}
    todo = list(reversed(names[""]))
    while todo:
        name = todo.pop()
        if name not in found:
            found[name] = None
            todo += reversed(names.get(name, ()))
    return list(found)
