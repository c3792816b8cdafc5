"""Many mutants in one build, each switched on by a number at run time: a program is compiled once for all of them, and
only those that it reaches are run.

What a switch cannot show is left to the ordinary way, one build a mutant: places that are not an expression or a
statement of their own, changes of a type, and whatever is computed while compiling, where every switch is off.
"""
import collections
import dataclasses
import re
import time

import mutate
import programs

HEADER = '''#pragma once
#include <cstdio>
#include <cstdlib>
#include <type_traits>
namespace fxdyn_mutants {
inline unsigned char reached[%d];
inline const int chosen = [] {
  if (std::getenv("FXDYN_REACHED") != nullptr)
    std::atexit([] {
      if (std::FILE* out = std::fopen(std::getenv("FXDYN_REACHED"), "w")) {
        for (unsigned i = 0; i < sizeof reached; ++i)
          if (reached[i] != 0) std::fprintf(out, "%%u\\n", i);
        std::fclose(out);
      }
    });
  const char* number = std::getenv("FXDYN_MUTANT");
  return number != nullptr ? std::atoi(number) : -1;
}();
constexpr bool on(int i) {
  if (std::is_constant_evaluated()) return false;
  reached[i] = 1;
  return chosen == i;
}
}  // namespace fxdyn_mutants
'''
KEPT_OUTPUT = 4_000_000  # characters of the compiler's messages: the first of them tells the place
LEAST_TIME_S = 4  # of processor time for a test, however quick it is
STOP_WORDS = ('return', 'else', 'case', 'do', 'throw', 'co_return', 'co_yield')
ASSIGNMENTS = {'=', *mutate.ASSIGNMENTS, '/=', '%='}
DECLARING = {'const', 'auto', 'constexpr', 'static', 'if', 'for', 'while', 'switch', 'using', 'template', 'struct', 'class',
             'enum', 'inline', 'constinit', 'consteval', 'typename', 'explicit', 'friend', 'operator', 'public', 'private'}


@dataclasses.dataclass
class Region:
    """text[start:end] that the mutants in it replace as a whole."""
    start: int
    end: int
    statement: bool
    mutants: list = dataclasses.field(default_factory=list)  # (number, Mutant)


def region_of(source, mutant):
    """(start, end, whether a statement) around a mutant; None where there is none."""
    text, tokens = source.text, source.tokens
    if mutant.operator == 'drop':
        end = text.find(';', mutant.end)
        return None if end < 0 or text[mutant.end:end].strip() else (mutant.start, end + 1, True)
    inside = [i for i, t in enumerate(tokens) if t.start < mutant.end and t.end > mutant.start]
    if not inside:
        return None
    first, asks = _leftmost(source, inside[0])
    last = _rightmost(source, inside[-1], asks)
    if tokens[first].text in DECLARING or any(tokens[i].text == '...' for i in range(first, last + 1)):
        return None
    return tokens[first].start, tokens[last].end, False


def _is_control(source, closing):
    """Whether the bracket that closes there ends if (..), for (..), while (..)."""
    i = source.partner.get(closing, 0) - 1
    if i >= 0 and source.tokens[i].text == 'constexpr':
        i -= 1
    return i >= 0 and source.tokens[i].text in ('if', 'for', 'while', 'switch')


def _leftmost(source, i):
    """The first token of the expression around token i, and whether a '?' stands before i in it."""
    tokens, text = source.tokens, source.text
    asks = 0
    while i > 0:
        before = tokens[i - 1]
        if before.text in STOP_WORDS or before.text in ASSIGNMENTS or before.text in (',', ';', '(', '[', '{', '<') and (
                before.text != '<' or i - 1 in source.partner):
            break
        if before.text in mutate.CLOSING or before.text in ('>', ']]') and i - 1 in source.partner:
            if before.text == ')' and _is_control(source, i - 1):
                break
            if before.text == '}' and text[before.end:before.end + 1] == '\n':
                break
            i = source.partner.get(i - 1, i - 1)
            continue
        if before.text == ':':
            if not _ternary_before(source, i - 1):
                break
        if before.text == '?':
            asks += 1
        i -= 1
    return i, asks > 0


def _ternary_before(source, colon):
    """Whether the colon belongs to a '?' before it."""
    tokens, j, depth = source.tokens, colon - 1, 0
    while j > 0 and tokens[j].text not in (',', ';', '(', '[', '{') and tokens[j].text not in ASSIGNMENTS:
        if tokens[j].text == '?':
            if depth == 0:
                return True
            depth -= 1
        depth += tokens[j].text == ':'
        j = source.partner.get(j, j) - 1 if tokens[j].text in mutate.CLOSING else j - 1
    return False


def _rightmost(source, i, asks):
    tokens = source.tokens
    if i in source.partner and source.partner[i] > i:
        i = source.partner[i]
    depth = 1 if asks else 0
    depth += tokens[i].text == '?'
    assigns = tokens[i].text in ASSIGNMENTS  # a += b *= c is a += (b *= c)
    while i + 1 < len(tokens):
        after = tokens[i + 1]
        if after.text in (',', ';') or after.text in mutate.CLOSING or after.text == ']]':
            break
        if after.text in ASSIGNMENTS and not assigns:
            break
        if after.text == ':':
            if depth == 0:
                break
            depth -= 1
        depth += after.text == '?'
        j = source.partner.get(i + 1, i + 1)
        i = max(j, i + 1)
    return i


def switched(text, numbered):
    """(text with all mutants switched, {line: numbers of the mutants whose region it shows}, numbers left out).
    numbered: (number, Mutant) of this file."""
    source = mutate.Source(text, (), mutate.TARGET_ONLY)
    for first, last in list(source.partner.items()):  # templates' brackets are known by the first one
        source.partner.setdefault(last, first)
    regions, left_out = {}, set()
    for number, mutant in numbered:
        where = region_of(source, mutant)
        if where is None:
            left_out.add(number)
        else:
            regions.setdefault(where, Region(*where)).mutants.append((number, mutant))
    ordered = sorted(regions.values(), key=lambda r: (r.start, -r.end, not r.statement))
    # Regions lie in one another or apart; what does not is left out.
    kept, stack = [], []
    for region in ordered:
        while stack and stack[-1].end <= region.start:
            stack.pop()
        if stack and region.end > stack[-1].end:
            left_out.update(n for n, _ in region.mutants)
            continue
        stack.append(region)
        kept.append(region)
    lines = collections.defaultdict(set)
    out = []

    def emit(piece):
        out.append(piece)
        emit.line += piece.count('\n')
    emit.line = 1

    def render(start, end, inner):
        at = start
        while inner:
            region = inner.pop(0)
            children = []
            while inner and inner[0].end <= region.end:
                children.append(inner.pop(0))
            emit(text[at:region.start])
            first = emit.line
            own = text[region.start:region.end]
            if region.statement:
                numbers = ' || '.join(f'fxdyn_mutants::on({n})' for n, _ in region.mutants)
                emit('{ if (!(%s)) { ' % numbers)
                render(region.start, region.end, children)
                emit(' } }')
            else:
                emit('(')
                for number, mutant in region.mutants:
                    new = own[:mutant.start - region.start] + mutant.new + own[mutant.end - region.start:]
                    emit(f'fxdyn_mutants::on({number}) ? ({new}) : ')
                emit('(')
                render(region.start, region.end, children)
                emit('))')
            for line in range(first, emit.line + 1):
                lines[line].update(n for n, _ in region.mutants)
            at = region.end
        emit(text[at:end])

    render(0, len(text), kept)
    return ''.join(out), lines, left_out


class Together:
    """Judges mutants by programs in which all of them stand."""

    def __init__(self, tree, mutants, log=print):
        """tree: programs.Tree, for this alone; mutants in their order, the number of each is its place."""
        self.tree, self.mutants, self.log = tree, mutants, log
        self.out = set()                                # no switch shows these
        self.passed = collections.defaultdict(set)      # number: programs that reach it and pass all the same
        self.not_asked = collections.defaultdict(set)   # number: programs that see its file and have not been run with it
        self.lines = {}                                 # file: {line: numbers}
        self.seen = {}                                  # program's name: files; a change leaves #include alone
        self.original = {f: tree.text(f) for f in {m.file for m in mutants}}
        (tree.root / 'fxdyn_switch.hpp').write_text(HEADER % len(mutants))
        for file in self.original:
            self._write(file)

    def _write(self, file):
        numbered = [(n, m) for n, m in enumerate(self.mutants) if m.file == file and n not in self.out]
        text, self.lines[file], left_out = switched(self.original[file], numbered)
        self.out |= left_out
        self.tree._write(file, text)

    def _leave_out(self, output):
        """The mutants in the lines that the compiler complains of; False where there are none."""
        found, hit = set(), set()
        for file, line in re.findall(r'(?m)^(?:In file included from |\s+from )?([\w/.-]+):(\d+)', output):
            file = file.removeprefix('./')
            if file in self.lines and self.lines[file].get(int(line)):
                hit.add((file, int(line)))
        errors = {(f.removeprefix('./'), int(l)) for f, l in re.findall(r'(?m)^([\w/.-]+):(\d+):\d+: error', output)}
        for file, line in (hit & errors) or hit:
            found |= self.lines[file][line]
        if not found:
            for file, line in errors:  # an error of syntax is told behind its place
                near = [l for l in self.lines.get(file, {}) if l <= line]
                if near:
                    found |= self.lines[file][max(near)]
        if not found:
            return False
        self.log(f'no switch for {len(found)} mutants')
        self.out |= found
        for file in {self.mutants[n].file for n in found}:
            self._write(file)
        return True

    def _compile(self, program, source, target):
        """(status, output)"""
        flags = self.tree._flags(program, False)
        command = ['g++', *[f for f in flags if not f.startswith('-fmax-errors')], '-fmax-errors=60',
                   *(f'-D{d}'.replace('@ROOT@', str(self.tree.root)) for d in program.definitions),
                   *self.tree._precompiled(flags), '-include', 'fxdyn_switch.hpp', '-c', source, '-o', target]
        status, output, _ = programs.run_limited(command, self.tree.root, programs.LONGEST_COMPILATION_S, memory=False,
                                                 kept=KEPT_OUTPUT)
        return status, output

    def _halve(self, program, source, target):
        """Where the messages name no switch: takes out one that breaks the source, found by compiling it with half of them
        again and again. False where the source is not compiled without any either."""
        before = set(self.out)
        every = [n for n, m in enumerate(self.mutants)
                 if n not in before and self._sees(program, m.file)]
        files = {self.mutants[n].file for n in every}

        def write(without):
            self.out = before.union(without)
            for file in files:
                self._write(file)

        def compiles(only):
            write(set(every) - set(only))
            return self._compile(program, source, target)[0] == 0

        suspects = every if every and compiles([]) else []
        while len(suspects) > 1:
            half = suspects[:len(suspects) // 2]
            suspects = suspects[len(half):] if compiles(half) else half
        write(suspects)
        if suspects:
            self.log(f'no switch for {self.mutants[suspects[0]].key}, found by halving')
        return bool(suspects)

    def _build(self, program):
        """(executable, error)"""
        objects = []
        for place, source in enumerate(program.sources):
            target = self.tree.changed / f'{program.name}-{place}.o'
            while True:
                status, output = self._compile(program, source, target)
                if status == 0:
                    break
                if not self._leave_out(output) and not self._halve(program, source, target):
                    return None, output[-1500:]
            objects.append(target)
        executable = self.tree.changed / f'{program.name}.together'
        status, output, _ = programs.run_limited(['g++', *objects, '-o', executable, *(f'-l{x}' for x in program.libraries)],
                                                 self.tree.root, 120, memory=False)
        for file in objects:
            file.unlink()
        return (executable, '') if status == 0 else (None, output[-1500:])

    def _run(self, executable, number, limit_s, reached=None):
        environment = {'RC_PARAMS': 'seed=1 noshrink=1', 'GTEST_FAIL_FAST': '1', 'GTEST_BRIEF': '1',
                       'FXDYN_MUTANT': str(number)}
        if reached:
            environment['FXDYN_REACHED'] = str(reached)
        status, output, seconds = programs.run_limited([executable], self.tree.root, limit_s, environment=environment)
        return programs.Tree._judged(status, output, 0, seconds)

    def judge(self, listed, deadline=float('inf')):
        """Yields (number, program's name, why) of what is killed. No program begins after the deadline, by the monotonic
        clock. A program that does not build or pass with all switches off is left to the ordinary way."""
        left = set(range(len(self.mutants)))
        waiting = [p for p in listed if not p.command]
        while waiting:
            program = max(waiting, key=lambda p: self._worth(p, left - self.out))
            waiting.remove(program)
            seen = {n for n in left - self.out if self._sees(program, self.mutants[n].file)}
            if not seen:
                continue
            if time.monotonic() > deadline:
                self._give_up(program, seen, 'is not asked: no time left')
                continue
            executable, error = self._build(program)
            if executable is None:
                self._give_up(program, seen, f'is not built with all switches off: {error}')
                continue
            reached_file = self.tree.changed / 'reached'
            reached_file.unlink(missing_ok=True)
            plain = self._run(executable, -1, programs.LONGEST_TEST_S, reached_file)
            if plain.result != 'passed':
                executable.unlink()
                self._give_up(program, seen, f'fails with all switches off: {plain.why}')
                continue
            reached = sorted({int(n) for n in reached_file.read_text().split()} & (left - self.out))
            self.log(f'{program.name}: {plain.seconds:.1f} s, reaches {len(reached)} of {len(left - self.out)} left')
            for number in reached:
                if time.monotonic() > deadline:
                    self.not_asked[number].add(program.name)
                    continue
                outcome = self._run(executable, number, max(LEAST_TIME_S, programs.TIMES_AS_LONG * plain.seconds))
                if outcome.result == 'failed':
                    left.discard(number)
                    yield number, program.name, outcome.why
                else:
                    self.passed[number].add(program.name)
            executable.unlink()

    def _give_up(self, program, seen, why):
        self.log(f'{program.name} {why}')
        for number in seen:
            self.not_asked[number].add(program.name)

    def _sees(self, program, file):
        if program.name not in self.seen:
            self.seen[program.name] = set().union(*(self.tree._files_of(program, s) for s in program.sources))
        return file in self.seen[program.name]

    def _worth(self, program, left):
        """What it may kill for its time: more where it tests the mutant's own folder."""
        seen = [self.mutants[n] for n in left if self._sees(program, self.mutants[n].file)]
        hope = sum(1 if any(s.startswith(f'tests/{m.file.split("/")[0]}/') for s in program.sources) else 0.4 for m in seen)
        return hope / program.seconds
