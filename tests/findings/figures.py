#!/usr/bin/env python3
"""The figures of docs/findings: made anew, and compared with what the pages say.

  figures.py --program FXDYN [--only NAME,..] [--short] [--keep] [--update] [--work DIR] [--list FILE]
  figures.py --check [--list FILE]     only whether every figure is on its page

Runs the commands of each project once, prints a table, and fails where a figure is worse than written by more than its
slack, where its place on the page is gone, or where a program fails. `--update` writes what was measured into the pages.
The list, figures.toml, says what there is and how its keys are meant.
"""
import argparse
import json
import math
import os
import pathlib
import re
import shlex
import subprocess
import sys
import time
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
NUMBER = re.compile(r'-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?')
KEYS = {'page', 'project', 'table', 'row', 'column', 'after', 'number', 'file', 'path', 'over', 'factor', 'better', 'slack',
        'reason'}
PROJECT_KEYS = {'name', 'commands', 'data', 'minutes', 'short'}


class Wrong(Exception):
    """What is wrong with a list, a page or a result, in one line."""


# --- the list ---------------------------------------------------------------------------------------------------------

def spread(file, group):
    """The figures of a [[figures]]: of a column's rows, of a row's columns, or of all cells of both."""
    which = [key for key in ('rows', 'columns') if key in group]
    if not which:
        raise Wrong(f'{file}: figures of {group.get("page")}: give rows or columns')
    common = {key: value for key, value in group.items() if key not in which}
    if len(which) == 1:
        return [{**common, which[0][:-1]: place, 'path': path} for place, path in group[which[0]].items()]
    return [{**common, 'row': row, 'column': column, 'path': begin + end}
            for row, begin in group['rows'].items() for column, end in group['columns'].items()]


def read_list(file):
    entries = tomllib.loads(pathlib.Path(file).read_text())
    projects = {}
    for project in entries.get('project', []):
        if unknown := set(project) - PROJECT_KEYS:
            raise Wrong(f'{file}: project {project.get("name")}: unknown key {sorted(unknown)[0]}')
        if not project.get('commands'):
            raise Wrong(f'{file}: project {project.get("name")}: no commands')
        projects[project['name']] = project
    figures = entries.get('figure', []) + [one for group in entries.get('figures', []) for one in spread(file, group)]
    for figure in figures:
        name = name_of(figure)
        if unknown := set(figure) - KEYS:
            raise Wrong(f'{file}: {name}: unknown key {sorted(unknown)[0]}')
        for key in ('page', 'project', 'file', 'path', 'better'):
            if key not in figure:
                raise Wrong(f'{file}: {name}: {key} is missing')
        if figure['better'] not in ('less', 'more', 'same'):
            raise Wrong(f'{file}: {name}: better = "less", "more" or "same"')
        if figure['project'] not in projects:
            raise Wrong(f'{file}: {name}: there is no project {figure["project"]}')
        if ('after' in figure) == ('column' in figure) or ('row' in figure and 'column' not in figure):
            raise Wrong(f'{file}: {name}: give row and column, or after')
        if not 0 <= figure.get('slack', 0) < 1:
            raise Wrong(f'{file}: {name}: slack is a share, at least 0 and below 1')
        if figure.get('slack', 0) > 0 and not figure.get('reason'):
            raise Wrong(f'{file}: {name}: a slack needs its reason')
    return projects, figures


def name_of(figure):
    place = figure.get('after') or ' | '.join(figure[key] for key in ('row', 'column') if key in figure)
    return ' '.join(f'{pathlib.Path(figure.get("page", "?")).stem}: {place}'.split())


# --- the page ---------------------------------------------------------------------------------------------------------

def plain(cell):
    return cell.replace('*', '').replace('`', '').strip()


def cells_of(line):
    """Begin and end of each cell of a table's line."""
    bars = [i for i, c in enumerate(line) if c == '|' and (i == 0 or line[i - 1] != '\\')]
    return [(a + 1, b) for a, b in zip(bars, bars[1:])]


def cell_place(text, figure):
    """Where the cell of `row` (without one: of the first row) and `column` is, in the first table with both after the
    line `table`."""
    start = 0
    if 'table' in figure:
        start = text.find(figure['table'])
        if start < 0:
            raise Wrong(f'{name_of(figure)}: the page has no line "{figure["table"]}"')
    head, at = None, start
    for line in text[start:].splitlines(keepends=True):
        cells = cells_of(line.rstrip('\n')) if line.startswith('|') else []
        texts = [plain(line[a:b]) for a, b in cells]
        if not cells:
            head = None
        elif head is None:
            head = texts
        elif set(''.join(texts)) <= set('-:'):
            pass  # the line under the heads
        elif figure['column'] in head and plain(figure.get('row', texts[0])) == texts[0]:
            column = head.index(figure['column'])
            if column < len(cells):
                return at + cells[column][0], at + cells[column][1]
        at += len(line)
    raise Wrong(f'{name_of(figure)}: no such row and column on the page')


def place_of(text, figure):
    """Begin and end of the figure's number in the page's text."""
    if 'after' in figure:
        if text.count(figure['after']) != 1:
            raise Wrong(f'{name_of(figure)}: the page has this text {text.count(figure["after"])} times, not once')
        begin = text.index(figure['after']) + len(figure['after'])
        end = text.find('\n\n', begin)
        end = len(text) if end < 0 else end
    else:
        begin, end = cell_place(text, figure)
    found = list(NUMBER.finditer(text, begin, end))
    which = figure.get('number', 1)
    if len(found) < which:
        raise Wrong(f'{name_of(figure)}: there is no number {which} at that place')
    return found[which - 1].span()


def rounding(written):
    """Half a unit of the last digit that is written."""
    mantissa, _, exponent = written.lower().partition('e')
    decimals = len(mantissa.partition('.')[2])
    return 0.5 * 10.0 ** (int(exponent or 0) - decimals)


def as_written(value, like):
    """A value with as many digits as the one that it replaces, and no fewer than two."""
    if 'e' in like.lower():
        digits = len(like.lower().partition('e')[0].partition('.')[2])
        mantissa, exponent = f'{value:.{digits}e}'.split('e')
        return f'{mantissa}e{int(exponent)}'
    decimals = len(like.partition('.')[2])
    if value != 0 and '.' in like:
        decimals = max(decimals, 1 - math.floor(math.log10(abs(value))))
    return f'{value:.{decimals}f}'


# --- the results ------------------------------------------------------------------------------------------------------

def is_named(value, word):
    """Whether a value is what a path calls it: 5 is "5" and "5.0"."""
    if isinstance(value, (int, float)) and not isinstance(value, bool) and NUMBER.fullmatch(word):
        return value == float(word)
    return str(value) == word


def step_into(values, part):
    """One part of a path: a key, [3], [*] or [key=value,key=value]."""
    out = []
    for value in values:
        if not part.startswith('['):
            out.append(value[part])
        elif part == '[*]':
            out.extend(value)
        elif '=' in part:
            wanted = dict(pair.split('=', 1) for pair in part[1:-1].split(','))
            out.extend(one for one in value if all(is_named(one.get(key), word) for key, word in wanted.items()))
        else:
            out.append(value[int(part[1:-1])])
    return out


REDUCE = {'mean': lambda v: sum(v) / len(v), 'min': min, 'max': max, 'count': len,
          'geomean': lambda v: math.exp(sum(math.log(x) for x in v) / len(v))}


def value_at(result, path):
    """The number at a path as methods[name=lugre].rmse[0]; mean(..), min(..), max(..), count(..), geomean(..) of several."""
    if match := re.fullmatch(r'(\w+)\((.*)\)', path):
        reduce, path = REDUCE[match.group(1)], match.group(2)
    else:
        reduce = None
    values = [result]
    for part in re.findall(r'\[[^\]]*\]|[^.\[\]]+', path):
        try:
            values = step_into(values, part)
        except (KeyError, IndexError, TypeError, AttributeError):
            raise Wrong(f'there is no {part} on the way of {path}') from None
    if reduce is None and len(values) != 1:
        raise Wrong(f'{path} is {len(values)} values')
    if reduce is not None and reduce is not len:
        if not values or any(not isinstance(v, (int, float)) or isinstance(v, bool) for v in values):
            raise Wrong(f'{path} has no numbers')
    value = reduce(values) if reduce else values[0]
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not math.isfinite(value):
        raise Wrong(f'{path} is no number: {value}')
    return value


def measured(figure, out):
    file = out / figure['file']
    if not file.is_file():
        raise Wrong(f'{name_of(figure)}: no file {figure["file"]}')
    result = json.loads(file.read_text())
    try:
        value = value_at(result, figure['path'])
        if 'over' in figure:
            value /= value_at(result, figure['over'])
    except Wrong as why:
        raise Wrong(f'{name_of(figure)}: {figure["file"]}: {why}') from None
    return value * figure.get('factor', 1)


def judged(figure, written, value):
    """'', or how it is worse than written."""
    published = float(written)
    room = figure.get('slack', 0) * abs(published) + rounding(written) * (1 + 1e-9)
    more, less = value > published + room, value < published - room
    if {'less': more, 'more': less, 'same': more or less}[figure['better']]:
        return 'WORSE' if figure['better'] != 'same' else 'ANOTHER'
    return ''


# --- a run ------------------------------------------------------------------------------------------------------------

def data_folder():
    return pathlib.Path(os.environ.get('FXDYN_DATA', ROOT / '..' / 'shared' / 'data'))


def run_project(project, program, out):
    """Its commands, one after the other. @return seconds"""
    out.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    for command in project['commands']:
        words = [word.format(out=out, data=data_folder()) for word in shlex.split(command)]
        with open(out / 'output.txt', 'a') as output:
            script = words[0].endswith('.py')  # of this repository; else a verb of fxdyn
            done = subprocess.run([sys.executable, *words] if script else [program, *words], cwd=ROOT, stdout=output, stderr=subprocess.STDOUT, check=False)
        if done.returncode != 0:
            last = (out / 'output.txt').read_text().strip().splitlines()[-1:]
            raise Wrong(f'project {project["name"]}: fxdyn {command}: {last[0] if last else "no output"}')
    return time.monotonic() - start


def chosen(projects, figures, options):
    names = {figure['project'] for figure in figures}
    if options.only:
        names = set(options.only.split(','))
        if unknown := names - set(projects):
            raise Wrong(f'no project {sorted(unknown)[0]}; there are {" ".join(sorted(projects))}')
    if options.short:
        names = {name for name in names if projects[name].get('short')}
    return [project for name, project in projects.items() if name in names]


def missing_data(project):
    """Why a project of measured logs can't run. A folder that was named, or has other sets in it, and lacks them is an
    error, as in tests/support/data.hpp."""
    name = project.get('data')
    if not name or (data_folder() / name).is_dir():
        return ''
    if 'FXDYN_DATA' in os.environ:
        raise Wrong(f'FXDYN_DATA is set, but has no folder {name}')
    if data_folder().is_dir():
        raise Wrong(f'{data_folder()} has no folder {name}')
    return f'no measured data: set FXDYN_DATA to the folder that holds {name}'


def look(figure, texts, out, update):
    """A line of the table, and whether it is right."""
    text = texts[figure['page']]
    begin, end = place_of(text, figure)
    written = text[begin:end]
    value = measured(figure, out)
    verdict = judged(figure, written, value)
    if update:
        texts[figure['page']] = text[:begin] + as_written(value, written) + text[end:]
    return f'{name_of(figure):<90.90} {written:>10} {value:>12.4g}  {verdict}', not verdict


def page_texts(figures, root):
    texts = {}
    for page in {figure['page'] for figure in figures}:
        if not (root / page).is_file():
            raise Wrong(f'there is no page {page}')
        texts[page] = (root / page).read_text()
    return texts


def run(options, root=ROOT):
    """@return how many complaints there are"""
    projects, figures = read_list(options.list)
    texts = page_texts(figures, root)
    complaints = []

    def attempt(action):
        try:
            return action()
        except Wrong as why:
            complaints.append(str(why))
            return None

    if options.check:
        for figure in figures:
            attempt(lambda figure=figure: place_of(texts[figure['page']], figure))
    else:
        for project in chosen(projects, figures, options):
            name, out = project['name'], options.work / project['name']
            why_not = attempt(lambda project=project: missing_data(project))
            if why_not is None:
                continue
            if why_not:
                print(f'{name}: skipped, {why_not}')
                continue
            if not (options.keep and out.is_dir()):
                seconds = attempt(lambda project=project, out=out: run_project(project, options.program, out))
                if seconds is None:
                    continue
                print(f'{name}: {seconds:.0f} s')
            print(f'{"":<90} {"written":>10} {"measured":>12}')
            for figure in (f for f in figures if f['project'] == name):
                line = attempt(lambda figure=figure, out=out: look(figure, texts, out, options.update))
                if line is None:
                    continue
                print(line[0])
                if not line[1] and not options.update:
                    complaints.append(f'{name_of(figure)}: worse than written')
        if options.update:
            for page, text in texts.items():
                if text != (root / page).read_text():
                    (root / page).write_text(text)
                    print(f'{page}: written')
    for complaint in complaints:
        print(f'figures.py: {complaint}', file=sys.stderr)
    return len(complaints)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--program', help='the program fxdyn')
    parser.add_argument('--list', type=pathlib.Path, default=HERE / 'figures.toml')
    parser.add_argument('--work', type=pathlib.Path, default=ROOT / 'build' / 'findings', help='folder of the results')
    parser.add_argument('--only', help='projects, with commas between them')
    parser.add_argument('--short', action='store_true', help='projects that take less than a minute or two')
    parser.add_argument('--keep', action='store_true', help='results that are there are not made again')
    parser.add_argument('--update', action='store_true', help='write what was measured into the pages')
    parser.add_argument('--check', action='store_true', help='run nothing: is every figure on its page?')
    options = parser.parse_args()
    options.work = options.work.resolve()
    if not options.check and not options.program:
        parser.error('--program is missing')
    if options.program:
        options.program = str(pathlib.Path(options.program).resolve())
    try:
        return 1 if run(options) else 0
    except Wrong as why:
        print(f'figures.py: {why}', file=sys.stderr)
        return 2


if __name__ == '__main__':
    sys.exit(main())
