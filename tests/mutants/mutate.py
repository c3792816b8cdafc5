"""Mutants of C++ source: small changes of one place each, found in the tokens of a clang-formatted file.

Not changed: comments, strings, preprocessor lines and what they switch off on the host, template brackets, attributes,
assembler and blocks that call it, concepts, using declarations and static_assert, which is a test itself.
"""
import bisect
import dataclasses
import re

TOKEN = re.compile(r'''
    (?P<comment>//[^\n]*|/\*.*?\*/)
  | (?P<directive>^[ \t]*\#(?:[^\n\\]|\\.)*(?:\\\n[^\n]*)*)
  | (?P<string>(?:u8|[uUL])?"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)+')
  | (?P<number>\.?\d(?:'[0-9A-Fa-f]|[eEpP][+-]|[\w.])*)
  | (?P<word>[A-Za-z_]\w*)
  | (?P<space>\s+)
  | (?P<operator><<=|>>=|<=>|->|\.\.\.|\+\+|--|&&|\|\||::|<<|>>|[-+*/%&|^<>=!]=|\[\[|\]\]|.)
''', re.VERBOSE | re.MULTILINE | re.DOTALL)

RELATIONS = {'<': ['<=', '>='], '<=': ['<', '>'], '>': ['>=', '<='], '>=': ['>', '<'], '==': ['!='], '!=': ['==']}
BINARY = {'+': ['-'], '-': ['+'], '*': ['+'], '/': ['*'], '%': ['*'], '&': ['|'], '|': ['&'], '^': ['|'],
          '<<': ['>>'], '>>': ['<<'], '&&': ['||'], '||': ['&&']}
ZERO = re.compile(r'(?:0[xXbB])?0+[uUlLzZ]*')
ASSIGNMENTS = {'+=': ['-='], '-=': ['+='], '*=': ['+='], '&=': ['|='], '|=': ['&='], '^=': ['|='], '<<=': ['>>='],
               '>>=': ['<<=']}
WORDS = {'true': ['false'], 'false': ['true'], 'min': ['max'], 'max': ['min'], 'break': [''], 'continue': ['']}
# Assembler of the targets: blocks that call it are templates that no host instantiates.
TARGET_ONLY = ('mask_interrupts', 'unmask_interrupts', 'wait_for_interrupt')
OPENING, CLOSING = '([{', ')]}'
# A statement that begins with one of these is no assignment and no call.
KEYWORDS = set('''return using static constexpr consteval constinit const auto struct class template case default if for
    while else do switch namespace typename friend public private protected enum break continue inline extern explicit
    static_assert void bool int unsigned char typedef operator goto throw new delete concept requires asm'''.split())
STATEMENT = re.compile(r'^(?:\+\+|--)?[\w.:>-]+(?:[({\[]|\+\+|--| (?:[-+*/%&|^]|<<|>>)?= |$)')


@dataclasses.dataclass(frozen=True)
class Token:
    kind: str
    text: str
    start: int

    @property
    def end(self):
        return self.start + len(self.text)


@dataclasses.dataclass(frozen=True)
class Mutant:
    """One change: text[start:end] becomes `new`. What names it in reports and reasons are the changed lines."""
    file: str
    operator: str
    start: int
    end: int
    new: str
    line_number: int
    line: str     # the lines that change, in one, without indentation
    becomes: str
    place: int    # the how many-th of the same lines in the file, from 1

    @property
    def key(self):
        return (self.file, self.line, self.becomes, self.place)

    def apply(self, text):
        return text[:self.start] + self.new + text[self.end:]


def tokens_of(text):
    return [Token(m.lastgroup, m.group(), m.start()) for m in TOKEN.finditer(text)]


def inactive(directives, defined):
    """Ranges of the text that the host's compiler does not see: what hangs on a macro that is not defined there."""
    ranges, stack = [], []
    for token in directives:
        words = re.findall(r'\w+', token.text)
        if words[0] in ('if', 'ifdef', 'ifndef'):
            names = [w for w in words[1:] if w != 'defined']
            known = len(names) == 1 and names[0] not in defined
            on = not known or (words[0] == 'ifndef') != ('!' in token.text)
            stack.append([on, known, token.end])
        elif words[0] in ('else', 'elif') and stack:
            on, known, since = stack[-1]
            if not on:
                ranges.append((since, token.start))
            stack[-1] = [not on or not known, known, token.end]
        elif words[0] == 'endif' and stack:
            on, _, since = stack.pop()
            if not on:
                ranges.append((since, token.start))
    return ranges


class Source:
    """A file with what its brackets enclose."""

    def __init__(self, text, defined=(), target_only=()):
        self.text = text
        every = tokens_of(text)
        self.skipped = inactive([t for t in every if t.kind == 'directive'], set(defined))
        self.tokens = [t for t in every if t.kind not in ('comment', 'directive', 'space')
                       and not any(a <= t.start < b for a, b in self.skipped)]
        self.partner = {}
        self._match_brackets()
        self._match_templates()
        self._skip_declarations(set(target_only))

    def spaced(self, i):
        """Whether a token has a space on both sides, as binary operators have and brackets of templates have not."""
        token = self.tokens[i]
        return self.text[token.start - 1:token.start].isspace() and self.text[token.end:token.end + 1].isspace()

    def _match_brackets(self):
        stack = []
        for i, token in enumerate(self.tokens):
            if token.kind != 'operator':
                continue
            for bracket in token.text if token.text in ('[[', ']]') else [token.text]:
                if bracket in OPENING:
                    stack.append(i)
                elif bracket in CLOSING and stack:
                    first = stack.pop()
                    self.partner[first], self.partner[i] = i, first

    def _match_templates(self):
        """Brackets of templates: their '<' has no space behind, relations have one on both sides."""
        i = 0
        while i < len(self.tokens):
            last = self._end_of_template(i) if self.tokens[i].text == '<' else None
            if last is not None:
                self.skipped.append((self.tokens[i].start, self.tokens[last].end))
                self.partner[i] = last
                i = last
            i += 1

    def _end_of_template(self, i):
        if self.text[self.tokens[i].end:self.tokens[i].end + 1].isspace():
            return None
        depth = 0
        j = i
        while j < len(self.tokens):
            text = self.tokens[j].text
            if text == '<' and not self.spaced(j):
                depth += 1
            elif text in ('>', '>>') and not self.spaced(j) or text in ('>', '>>') and j > i and depth == len(text):
                depth -= len(text)
                if depth <= 0:
                    return j
            elif text in OPENING and text != '<':
                j = self.partner.get(j, j)
            elif text in (';', '{', '}'):
                return None
            j += 1
        return None

    def _skip_declarations(self, target_only):
        """static_assert, asm, concept and using up to their semicolon; attributes; blocks with calls that only a target
        can make."""
        blocks = []
        for i, token in enumerate(self.tokens):
            if token.text == '{' and i in self.partner:
                blocks.append(i)
            elif token.text == '}' and blocks:
                blocks.pop()
            elif token.text in target_only and blocks:
                block = blocks[-1]
                self.skipped.append((self.tokens[block].start, self.tokens[self.partner[block]].end))
            if token.text in ('static_assert', 'asm', 'concept', 'using'):
                self.skipped.append((token.start, self.tokens[self.end_of_statement(i)].end))
            elif token.text == '[[':
                self.skipped.append((token.start, self.tokens[self.partner.get(i, i)].end))
        self.skipped.sort()

    def end_of_statement(self, i):
        """The semicolon that ends what begins at token i."""
        while i < len(self.tokens) - 1 and self.tokens[i].text != ';':
            if self.tokens[i].text in CLOSING:
                return i
            i = max(self.partner.get(i, i), i) + 1
        return i

    def is_skipped(self, token):
        return any(a <= token.start < b for a, b in self.skipped)


def changed_number(text):
    """A literal's neighbours, in the literal's own base: n + 1, n - 1."""
    plain = re.fullmatch(r"(0[xX][0-9A-Fa-f']+|0[bB][01']+|\d[\d']*)([uUlLzZ]*)", text)
    if not plain:
        real = re.fullmatch(r'(\d*\.\d*|\d+(?:\.\d*)?[eE][-+]?\d+)([fFlL]?)', text)
        return [f'({text} + 1)', f'(2 * {text})'] if real else []
    digits, suffix = plain.groups()
    base = {'0x': 16, '0b': 2}.get(digits[:2].lower(), 10)
    value = int(digits.replace("'", ''), base if base != 10 else 10)
    write = {16: lambda n: f'0x{n:x}', 2: lambda n: f'0b{n:b}', 10: str}[base]
    return [write(n) + suffix for n in ([value + 1] + ([value - 1] if value > 0 else []))]


def _changes(source):
    """(operator, start, end, new) of every change."""
    tokens = source.tokens
    for i, token in enumerate(tokens):
        if source.is_skipped(token):
            continue
        text = token.text
        if token.kind == 'number':
            for new in changed_number(text):
                yield 'number', token.start, token.end, new
        elif token.kind == 'word':
            yield from _changes_of_word(source, i)
        elif '...' in (tokens[i - 1].text, tokens[min(i + 1, len(tokens) - 1)].text):
            continue  # a fold
        elif source.spaced(i) and (text in RELATIONS or text in BINARY or text in ASSIGNMENTS):
            kind = 'relation' if text in RELATIONS else 'arithmetic' if text in BINARY else 'assignment'
            if text in ('+', '-', '<<', '>>') and ZERO.fullmatch(tokens[min(i + 1, len(tokens) - 1)].text):
                continue  # x + 0 is x - 0
            for new in (RELATIONS.get(text) or BINARY.get(text) or ASSIGNMENTS[text]):
                yield kind, token.start, token.end, new
        elif text in ('++', '--'):
            yield 'increment', token.start, token.end, {'++': '--', '--': '++'}[text]
        elif text in ('!', '~') or text == '-' and _is_unary(source, i):
            yield 'negation', token.start, token.end, ''
        elif text == '?':
            yield from _swapped_ternary(source, i)
    yield from _dropped_statements(source)


def _is_unary(source, i):
    token, before = source.tokens[i], source.text[source.tokens[i].start - 1]
    return before in '( [{,' and not source.text[token.end].isspace()


def _changes_of_word(source, i):
    tokens, token = source.tokens, source.tokens[i]
    following = tokens[i + 1].text if i + 1 < len(tokens) else ''
    if token.text in ('break', 'continue'):
        if following == ';':
            yield 'drop', token.start, token.end, ''
    elif token.text in ('min', 'max'):
        if i > 0 and tokens[i - 1].text == '::':
            yield 'minimum', token.start, token.end, WORDS[token.text][0]
    elif token.text in WORDS:
        yield 'truth', token.start, token.end, WORDS[token.text][0]
    elif token.text in ('if', 'while') and following == '(':
        first, last = tokens[i + 1].end, tokens[source.partner[i + 1]].start
        condition = source.text[first:last]
        if ';' in condition or condition in ('true', 'false'):
            return
        for new in ('false', 'true') if token.text == 'if' else ('false',):
            yield 'condition', first, last, new


def _swapped_ternary(source, i):
    """c ? a : b becomes c ? b : a."""
    tokens = source.tokens
    j, depth = i + 1, 0
    while j < len(tokens) and (depth > 0 or tokens[j].text != ':'):
        if tokens[j].text in CLOSING + ';':
            return
        depth += (tokens[j].text == '?') - (tokens[j].text == ':')
        j = max(source.partner.get(j, j), j) + 1
    k = j + 1
    while k < len(tokens) and tokens[k].text not in (',', ';', ')', ']', '}'):
        k = max(source.partner.get(k, k), k) + 1
    if k >= len(tokens):
        return
    first, colon, second = (tokens[i].end, tokens[j].start), tokens[j], (tokens[j].end, tokens[k].start)
    a, b = source.text[slice(*first)].strip(), source.text[slice(*second)].strip()
    yield 'ternary', first[0], second[1], f' {b} {colon.text} {a}'


def _dropped_statements(source):
    """Assignments and calls that stand alone."""
    tokens = source.tokens
    for i, token in enumerate(tokens):
        if i == 0 or source.is_skipped(token) or token.text in KEYWORDS or token.kind not in ('word', 'operator'):
            continue
        before = tokens[i - 1].text
        if before not in (';', '{', '}', 'else') and not (before == ')' and _ends_control(source, i - 1)):
            continue
        last = source.end_of_statement(i)
        if tokens[last].text != ';':
            continue
        if STATEMENT.match(' '.join(source.text[token.start:tokens[last].start].split())):
            yield 'drop', token.start, tokens[last].start, ''


def _ends_control(source, i):
    first = source.partner.get(i)
    return first is not None and first > 0 and source.tokens[first - 1].text in ('if', 'for', 'while')


def mutants_of(file, text, defined=(), target_only=TARGET_ONLY):
    """All mutants of one file, in its order."""
    source = Source(text, defined, target_only)
    starts = [0] + [m.end() for m in re.finditer('\n', text)]
    squeezed = [' '.join(line.split()) for line in text.split('\n')]
    result, seen = [], set()
    for operator, start, end, new in sorted(_changes(source), key=lambda c: c[1:]):
        if text[start:end] == new:
            continue
        first, last = bisect.bisect_right(starts, start) - 1, bisect.bisect_right(starts, max(start, end - 1)) - 1
        stop = starts[last + 1] - 1 if last + 1 < len(starts) else len(text)
        line = ' '.join(squeezed[first:last + 1])
        becomes = ' '.join((text[starts[first]:start] + new + text[end:stop]).split())
        same = [n for n, other in enumerate(squeezed) if other == squeezed[first]]
        mutant = Mutant(file, operator, start, end, new, first + 1, line, becomes, same.index(first) + 1)
        if mutant.key not in seen:
            seen.add(mutant.key)
            result.append(mutant)
    return result
