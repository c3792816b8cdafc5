#!/usr/bin/env python3
"""Random mutants of model/, firmware/ and hal/: which of them do the tests notice?

  mutants.py --count 300 --seed 20          so many mutants of all files; a report with every survivor
  mutants.py --count 300 --seed 22 --together   the same, as many as can be in one build, switched on at run time
  mutants.py --changed [REF] --count 10     what was changed since the last commit that REF has as well (HEAD~20, or
                                            FXDYN_LANDED_ON): lines first, then their files; none or no history: of all
  mutants.py --known                        the list in known.toml: every one has to be killed
  mutants.py --again RESULTS                the survivors of an earlier run once more
  mutants.py --check                        known.toml and reasons.toml still fit the sources

Test programs and files: programs.toml. A mutant is killed where a test fails, crashes, does not end, or is refused by a
check at compile time; one that is no valid program counts nothing and another is drawn. Survivors that no test can
kill stand in reasons.toml. Fails where more survive without a reason than --allow says, but for one.
"""
import argparse
import collections
import dataclasses
import fcntl
import fnmatch
import hashlib
import itertools
import json
import multiprocessing
import os
import pathlib
import random
import re
import subprocess
import sys
import time
import tomllib

sys.dont_write_bytecode = True  # nothing is written into the sources
import mutate
import programs
import together

HERE = pathlib.Path(__file__).resolve().parent
PROJECT = HERE.parents[1]
GOLDEN = {'': 'tests/golden', '_remembers': 'tests/golden/remembers'}
FOLDERS = ('model', 'firmware', 'hal')
FIRST_VERDICT = 1.5  # times --seconds, where nothing has a verdict yet: a run without one says nothing
SPARE = 1.15       # of what is drawn, some are no valid programs
NOT_ASKED = 'slow programs were not asked'


@dataclasses.dataclass
class Settings:
    """programs.toml."""
    programs: list
    left_out: list
    folders: list
    headers: list
    includes: list = ()
    not_used: dict = dataclasses.field(default_factory=dict)

    @classmethod
    def load(cls, path):
        data = tomllib.loads(path.read_text())
        groups = data.get('group', {})
        listed = []
        for entry in data['program']:
            for name in entry.pop('groups', []):
                entry['sources'] = [*entry['sources'], *groups[name]]
            golden, name = entry.pop('golden', False), entry.pop('name')
            made = programs.Program(name, **{k: tuple(v) if isinstance(v, list) else v for k, v in entry.items()})
            listed += [of_golden(made, *model) for model in GOLDEN.items()] if golden else [made]
        return cls(listed, data.get('left_out', []), data['folders'], data['headers'], data.get('includes', []),
                   data.get('not_used', {}))

    def reason_to_leave_out(self, file):
        return next((e['why'] for e in self.left_out for p in e['files'] if fnmatch.fnmatch(file, p)), None)


def of_golden(program, suffix, folder):
    headers = tuple(f'FXDYN_{what.upper()}_HEADER="{folder}/{what}.hpp"' for what in ('tables', 'vectors'))
    return dataclasses.replace(program, name=program.name + suffix, definitions=program.definitions + headers)


def files_to_change(settings, project=PROJECT):
    """Every source of the three folders that a test program of the host sees."""
    files = []
    for folder in FOLDERS:
        for path in sorted((project / folder).rglob('*')):
            if path.suffix in ('.hpp', '.cpp'):
                file = str(path.relative_to(project))
                if settings.reason_to_leave_out(file) is None:
                    files.append(file)
    return files


def drawn(files, seed, project=PROJECT):
    """Mutants in the order in which they are tried: places at random, at each one of its changes; then the others."""
    places = collections.defaultdict(list)
    for file in files:
        for mutant in mutate.mutants_of(file, (project / file).read_text()):
            places[file, mutant.start].append(mutant)
    generator = random.Random(seed)
    groups = list(places.values())
    while groups:
        generator.shuffle(groups)
        for group in groups:
            yield group.pop(generator.randrange(len(group)))
        groups = [g for g in groups if g]


# --- one mutant --------------------------------------------------------------------------------------------------------

class Judge:
    """Runs the tests that see a mutant until one fails; those first that killed most for their time."""

    def __init__(self, project, settings, work, number, sanitize, quick=False):
        self.settings, self.sanitize, self.quick = settings, sanitize, quick
        self.tree = programs.Tree(project, work, number, settings.folders, settings.headers, settings.includes)
        self.kills, self.tries, self.cost = collections.Counter(), collections.Counter(), {}

    def programs_for(self, file):
        seeing = [p for p in self.settings.programs if self.tree.program_sees(p, file)]
        def worth(program):
            key = (file, program.name)
            near = any(s.startswith(f'tests/{folder_of(file)}/') for s in program.sources)
            prior = 0.9 if near else 0.3  # of the chance that it kills
            return (self.kills[key] + prior) / (self.tries[key] + 1) / self.cost.get(program.name, program.seconds)
        return sorted(seeing, key=worth, reverse=True)

    def judge(self, mutant, deadline=float('inf')):
        """{result: killed | survived | invalid | unseen | undecided, by, why, seconds}; no program begins after the
        deadline, by the monotonic clock."""
        seeing = self.programs_for(mutant.file)
        spent = 0.0
        for sanitize in (False, True) if self.sanitize else (False,):
            for program in seeing:
                if sanitize and not program.sanitize or self.quick and program.slow:
                    continue
                if time.monotonic() > deadline:
                    return {'result': 'undecided', 'by': '', 'why': 'no time left', 'seconds': spent}
                normal = self.tree.normal_seconds(program, sanitize)
                self.tree.change(mutant.file, mutant.apply(self.tree.text(mutant.file)))
                try:
                    outcome = self.tree.run(program, sanitize, normal)
                finally:
                    self.tree.restore()
                spent += outcome.seconds
                self.tries[mutant.file, program.name] += 1
                self.cost[program.name] = max(outcome.seconds, 0.1)
                if outcome.result == 'invalid':
                    return {'result': 'invalid', 'by': program.name, 'why': outcome.why, 'seconds': spent}
                if outcome.result == 'failed':
                    self.kills[mutant.file, program.name] += 1
                    return {'result': 'killed', 'by': program.name + (' (sanitizers)' if sanitize else ''),
                            'why': outcome.why, 'seconds': spent}
        slow = self.quick and any(p.slow for p in seeing)
        result = 'unseen' if not seeing else 'undecided' if slow and all(p.slow for p in seeing) else 'survived'
        return {'result': result, 'by': '', 'why': NOT_ASKED if slow else '', 'seconds': spent}


_judge = None


def _start_worker(settings, work, sanitize, quick):
    global _judge
    number = (multiprocessing.current_process()._identity or [0])[0]
    _judge = Judge(PROJECT, settings, work, number, sanitize, quick)


def _judge_one(mutant, deadline):
    return _judge.judge(mutant, deadline)


class Judges:
    """`jobs` of them at once, each with a tree of its own."""

    def __init__(self, settings, options):
        self.start = (settings, options.work, not (options.no_sanitizers or options.quick), options.quick)
        self.jobs, self.pool = options.jobs, None

    def __enter__(self):
        if self.jobs == 1:
            _start_worker(*self.start)
        else:
            self.pool = multiprocessing.Pool(self.jobs, _start_worker, self.start)
        return self

    def __exit__(self, *_):
        if self.pool:
            self.pool.terminate()

    @property
    def ahead(self):
        """Mutants under way at once: more than jobs, so that one that takes long does not keep the others waiting."""
        return 8 * self.jobs if self.pool else 1

    def begin(self, mutant, deadline):
        """A function that waits for the verdict."""
        if self.pool:
            return self.pool.apply_async(_judge_one, (mutant, deadline)).get
        verdict = _judge.judge(mutant, deadline)
        return lambda: verdict


def judge_together(mutants, settings, options, noted, deadline):
    """Notes the mutants that switched builds kill. Returns what is known of the others, for where no time is left to judge
    them one by one: {key: verdict}."""
    fresh = [m for m in mutants if m.key not in noted.known]
    tree = programs.Tree(PROJECT, options.work, 'together', settings.folders, settings.headers, settings.includes)
    judging = together.Together(tree, fresh, lambda text: print(text, flush=True))
    asked = [p for p in settings.programs if not (options.quick and p.slow)]
    killed = set()
    for number, by, why in judging.judge(asked, deadline):
        killed.add(number)
        noted.note(fresh[number], {'result': 'killed', 'by': f'{by} (switched)', 'why': why, 'seconds': 0})
    left = {n: m for n, m in enumerate(fresh) if n not in killed and n not in judging.out}
    print(f'{len(fresh)} mutants in one build: {len(killed)} killed, {len(judging.out)} without a switch', flush=True)
    return {m.key: {'result': 'survived', 'by': '', 'why': 'in switched builds', 'seconds': 0}
            for n, m in left.items() if judging.passed[n] and not judging.not_asked[n]}


# --- lists -------------------------------------------------------------------------------------------------------------

def load_reasons(path):
    """key -> why"""
    if not path.exists():
        return {}
    return {(r['file'], r['line'], r['becomes'], r.get('place', 1)): r['why']
            for r in tomllib.loads(path.read_text()).get('reason', [])}


def load_known(path, project=PROJECT):
    """(mutants, complaints): the edits of known.toml, each a pattern that has to stand in its file exactly once."""
    found, complaints = [], []
    for entry in tomllib.loads(path.read_text())['known']:
        for edit in entry['edits']:
            files = edit.get('files') or [edit['file']]
            texts = {f: (project / f).read_text() for f in files if (project / f).is_file()}
            matches = [(f, m) for f, text in texts.items() for m in re.finditer(edit['pattern'], text)]
            if len(matches) != 1:
                complaints.append(f'known.toml, {entry["name"]}: stands {len(matches)} times in {" ".join(files)}: '
                                  f'{edit["pattern"]}')
                continue
            file, match = matches[0]
            line = ' '.join(match.group().split())
            becomes = match.expand(edit['becomes'])
            found.append(mutate.Mutant(file, entry['name'], match.start(), match.end(), becomes,
                                       texts[file].count('\n', 0, match.start()) + 1, line, ' '.join(becomes.split()), 1))
    return found, complaints


def git(*words):
    """What git says; nothing where it fails."""
    said = subprocess.run(['git', *words], cwd=PROJECT, capture_output=True, text=True)
    return said.stdout if said.returncode == 0 else ''


def base_of(reference):
    """The last commit that the reference and HEAD have in common; the first of all where history is too short."""
    return git('merge-base', reference, 'HEAD').strip() or git('rev-list', '--max-parents=0', 'HEAD').split('\n')[0]


def lines_of_diff(diff):
    """{file: numbers of the lines that a diff without context adds or changes}"""
    changed, file = {}, None
    for line in diff.split('\n'):
        if line.startswith('+++ '):
            file = line[6:] if line.startswith('+++ b/') else None
        elif file and (hunk := re.match(r'@@ -\S+ \+(\d+)(?:,(\d+))? @@', line)):
            first, count = int(hunk[1]), int(hunk[2] or 1)
            changed.setdefault(file, set()).update(range(first, first + count))
    return changed


def changed_lines(reference):
    """The same of all that differs from a reference, uncommitted changes too."""
    base = base_of(reference)
    return lines_of_diff(git('diff', '-U0', base)) if base else {}


def tree_hash(settings, how):
    """Of all that a verdict depends on."""
    digest = hashlib.sha256(repr((settings.programs, how)).encode())
    for folder in settings.folders:
        for path in sorted((PROJECT / folder).rglob('*')):
            if path.suffix in ('.hpp', '.cpp', '.toml', '.py', '.urdf') and 'mutants' not in path.parts:
                digest.update(str(path.relative_to(PROJECT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


class Results:
    """One line of JSON a verdict, so that a run that was stopped goes on where it was; only for the same tree."""

    def __init__(self, path, tree):
        self.path, self.tree, self.known = path, tree, {}
        for entry in read_results(path):
            if entry['tree'] == tree:
                self.known[entry['file'], entry['line'], entry['becomes'], entry['place']] = entry

    def note(self, mutant, verdict):
        entry = {'tree': self.tree, **dataclasses.asdict(mutant), **verdict}
        self.known[mutant.key] = entry
        with self.path.open('a') as out:
            out.write(json.dumps(entry) + '\n')


def read_results(path):
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


# --- report ------------------------------------------------------------------------------------------------------------

def folder_of(file):
    return file.split('/')[0]


def report(title, results, reasons, settings):
    """Markdown."""
    lines = [f'# Mutants: {title}', '', '| folder | valid | killed | of them: compile time | out of time | survived '
             '| with a reason | invalid, drawn again | undecided |', '|---|---|---|---|---|---|---|---|---|']
    def row(name, some):
        killed = [r for _, r in some if r['result'] == 'killed']
        left = [m for m, r in some if r['result'] in ('survived', 'unseen')]
        valid = len(killed) + len(left)
        share = f' ({100 * len(killed) / valid:.1f} %)' if valid else ''
        return (f'| {name} | {valid} | {len(killed)}{share} | {sum(": error:" in r["why"] for r in killed)} '
                f'| {sum(r["why"] == programs.OUT_OF_TIME for r in killed)} | {len(left)} '
                f'| {sum(m.key in reasons for m in left)} | {sum(r["result"] == "invalid" for _, r in some)} '
                f'| {sum(r["result"] == "undecided" for _, r in some)} |')
    lines += [row(f, [x for x in results if folder_of(x[0].file) == f]) for f in FOLDERS] + [row('all', results)]
    lines += ['', '## Survivors', '']
    for mutant, verdict in results:
        if verdict['result'] in ('survived', 'unseen'):
            why = reasons.get(mutant.key) or ('no test program sees this file' if verdict['result'] == 'unseen'
                                              else '**no reason: write a test that kills it, or say why none can**')
            lines += [f'{mutant.file}:{mutant.line_number} ({mutant.operator})', '```diff', f'- {mutant.line}',
                      f'+ {mutant.becomes}', '```', why, '']
    lines += ['## Not changed', '', *(f'- {" ".join(e["files"])}: {e["why"]}' for e in settings.left_out), '']
    return '\n'.join(lines)


def without_reason(results, reasons):
    return [m for m, r in results if r['result'] in ('survived', 'unseen') and m.key not in reasons]


# --- command line ------------------------------------------------------------------------------------------------------

def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--count', type=int, default=300, help='valid mutants to judge')
    parser.add_argument('--seed', type=int, default=20)
    parser.add_argument('--changed', nargs='?', const=os.environ.get('FXDYN_LANDED_ON') or 'HEAD~20', metavar='REF')
    parser.add_argument('--files', nargs='*', default=['*'], metavar='PATTERN', help='only of these files')
    parser.add_argument('--known', nargs='?', const='', metavar='NAME', help='all of known.toml, or those named so')
    parser.add_argument('--again', type=pathlib.Path, metavar='RESULTS')
    parser.add_argument('--check', action='store_true')
    parser.add_argument('--seconds', type=float, default=float('inf'), help='no new mutant after this time')
    parser.add_argument('--allow', type=float, default=5, metavar='PERCENT', help='survivors without a reason')
    parser.add_argument('--no-sanitizers', action='store_true', help='spare survivors the second round with sanitizers')
    parser.add_argument('--quick', action='store_true', help='neither sanitizers nor slow programs; a survivor is one of '
                        'the others, and undecided where there are none')
    parser.add_argument('--together', action='store_true', help='at first as many as can be in one build of each program, '
                        'switched on at run time; half of --seconds')
    parser.add_argument('--without', nargs='*', default=[], metavar='PROGRAM',
                        help='spare these programs; survivors are then only candidates for --again')
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument('--work', type=pathlib.Path, default=PROJECT / 'build/mutants', help='objects, results, report')
    parser.add_argument('--results', type=pathlib.Path, help='default: WORK/results-SEED.jsonl')
    options = parser.parse_args()
    options.work = options.work.resolve()
    return options


def check(settings, reasons):
    _, complaints = load_known(HERE / 'known.toml')
    texts = {}
    for file, line, becomes, place in reasons:
        if file not in texts:
            path = PROJECT / file
            texts[file] = {m.key for m in mutate.mutants_of(file, path.read_text())} if path.exists() else set()
        if (file, line, becomes, place) not in texts[file]:
            complaints.append(f'reasons.toml: no such mutant any more: {file}: {line} -> {becomes} (place {place})')
    return complaints


def choose(options, settings):
    """(title, mutants to try, how many valid ones to judge)"""
    if options.known is not None:
        mutants, complaints = load_known(HERE / 'known.toml')
        if complaints:
            sys.exit('\n'.join(complaints))
        mutants = [m for m in mutants if options.known in m.operator]
        return 'the known list', mutants, len(mutants)
    files = [f for f in files_to_change(settings) if any(fnmatch.fnmatch(f, p) for p in options.files)]
    if options.again:
        survivors = {(e['file'], e['line'], e['becomes'], e['place']) for e in read_results(options.again)
                     if e['result'] in ('survived', 'unseen')}
        mutants = [m for f in files for m in mutate.mutants_of(f, (PROJECT / f).read_text()) if m.key in survivors]
        return f'survivors of {options.again.name} again', mutants, len(mutants)
    title = f'seed {options.seed}'
    lines = changed_lines(options.changed) if options.changed else {}
    changed = sorted(set(lines).intersection(files))
    if changed:
        title += f', of what was changed since {options.changed}: {" ".join(changed)}'
    mutants = drawn(changed or files, options.seed)
    if changed:
        mutants = sorted(mutants, key=lambda m: m.line_number not in lines[m.file])
    return title, iter(mutants), options.count


def commit():
    return git('describe', '--always', '--dirty').strip() or 'unknown'


def main():
    options = arguments()
    settings = Settings.load(HERE / 'programs.toml')
    settings.programs = [p for p in settings.programs if p.name not in options.without]
    reasons = load_reasons(HERE / 'reasons.toml')
    if options.check:
        complaints = check(settings, reasons)
        print('\n'.join(complaints) or 'known.toml and reasons.toml fit the sources')
        return 1 if complaints else 0
    title, mutants, count = choose(options, settings)
    options.work.mkdir(parents=True, exist_ok=True)
    lock = (options.work / 'lock').open('w')
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        sys.exit(f'{options.work} is in use by another run; --work names another folder')
    path = options.results or options.work / f'results-{options.seed}.jsonl'
    noted = Results(path, tree_hash(settings, (options.no_sanitizers, options.quick))) if options.known is None else None
    results, start, of_switches = [], time.monotonic(), {}
    if options.together and noted:
        first = list(itertools.islice(mutants, int(SPARE * count) + 1))
        mutants = itertools.chain(first, mutants)
        of_switches = judge_together(first, settings, options, noted, start + options.seconds / 2)

    def verdicts(judges):
        """(mutant, verdict, whether it is new) in the order in which the mutants are drawn, so that the same seed
        judges the same ones however many jobs there are. The first may take longer: a run without one says nothing."""
        under_way, begun = collections.deque(), 0
        for mutant in mutants:
            known = noted.known.get(mutant.key) if noted else None
            if known is None:
                first = begun < options.jobs and not (of_switches or noted and noted.known)
                deadline = start + options.seconds * (FIRST_VERDICT if first else 1)
                under_way.append((mutant, judges.begin(mutant, deadline), True))
                begun += 1
            else:
                under_way.append((mutant, lambda verdict=known: verdict, False))
            if len(under_way) == judges.ahead:
                mutant, verdict, new = under_way.popleft()
                yield mutant, verdict(), new
        for mutant, verdict, new in under_way:
            yield mutant, verdict(), new

    with Judges(settings, options) as judges:
        for mutant, verdict, new in verdicts(judges):
            if verdict['result'] == 'undecided':
                verdict = of_switches.get(mutant.key, verdict)
            results.append((mutant, verdict))
            if new and noted and verdict['result'] != 'undecided':
                noted.note(mutant, verdict)
            valid = sum(r['result'] not in ('invalid', 'undecided') for _, r in results)
            if new:
                print(f'{valid:4} {verdict["result"]:8} {mutant.file}:{mutant.line_number} {mutant.operator}: '
                      f'{verdict["by"]} {verdict["why"][:90]} ({verdict["seconds"]:.0f} s)', flush=True)
            if valid >= count or time.monotonic() - start > options.seconds:
                break
    text = report(f'{title}, commit {commit()}', results, reasons, settings)
    (options.work / 'report.md').write_text(text)
    print(text)
    left = without_reason(results, reasons)
    valid = sum(r['result'] not in ('invalid', 'undecided') for _, r in results)
    allowed = 0 if options.known is not None else max(1, int(options.allow / 100 * valid))
    print(f'{valid} mutants in {time.monotonic() - start:.0f} s, {len(left)} survive without a reason, '
          f'{allowed} allowed; report: {options.work / "report.md"}')
    return 1 if len(left) > allowed or (options.known is not None and any(
        r['result'] == 'invalid' for _, r in results)) else 0


if __name__ == '__main__':
    sys.exit(main())
