#!/usr/bin/env python3
"""mutate.py, programs.py and mutants.py on sources made up for the purpose."""
import contextlib
import dataclasses
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import mutants
import mutate
import programs
import together


def changes(text, defined=()):
    """Lines after the change, of every mutant."""
    return {m.becomes for m in mutate.mutants_of('toy.hpp', text, defined)}


class Mutate(unittest.TestCase):
    def test_what_a_line_becomes(self):
        self.assertEqual(changes('bool f() { return a < b && !c; }'),
                         {'bool f() { return a <= b && !c; }', 'bool f() { return a >= b && !c; }',
                          'bool f() { return a < b || !c; }', 'bool f() { return a < b && c; }'})

    def test_numbers_keep_base_and_suffix(self):
        self.assertEqual(changes('x = f(0xFF);') & {'x = f(0x100);', 'x = f(0xfe);'}, {'x = f(0x100);', 'x = f(0xfe);'})
        self.assertIn("y = 0b100U;", changes("y = 0b11U;"))
        self.assertIn("y = 20001;", changes("y = 20'000;"))
        self.assertNotIn('y = -1;', changes('y = 0;'))

    def test_statements_are_dropped(self):
        text = 'void f() {\n  int a = 1;\n  a_ = b;\n  if (c) g(1 + 2);\n  return h();\n}\n'
        dropped = {m.line for m in mutate.mutants_of('toy.hpp', text) if m.operator == 'drop'}
        self.assertEqual(dropped, {'a_ = b;', 'if (c) g(1 + 2);'})

    def test_conditions_and_ternaries(self):
        self.assertTrue({'if (false) f();', 'if (true) f();', 'if (g(a)) ;'} <= changes('{\nif (g(a)) f();\n}'))
        self.assertIn('x = c ? (d ? e : f) : a;', changes('x = c ? a : (d ? e : f);'))
        self.assertIn('x = c ? d ? e : f : a;', changes('x = c ? a : d ? e : f;'))

    def test_what_is_no_code_or_a_test_itself_stays(self):
        for text in ('// a + b', '/* 1 */', 'static_assert(a < 3);', 'using A = B<3>;', '[[nodiscard]]', 'std::array<int, 3> x',
                     'template <int a = 3, class B>', '#define A 1 + 2', 'asm volatile("add" : : "r"(1));',
                     'concept C = requires(T t) { t + 1; };', '(0 + ... + a<B>)'.replace('0', 'z'), 'const char* c = "1 < 2";',
                     'T&& t', 'const T& t', 'T* t'):
            self.assertEqual(changes(text), set(), text)

    def test_nothing_added_or_shifted_by_nothing_is_no_change(self):
        self.assertEqual([b for b in changes('x = 1U << 0, y = a + 0x00;') if '>>' in b or 'a -' in b], [])
        self.assertIn('x = a - 0x10;', changes('x = a + 0x10;'))

    def test_a_template_bracket_hides_no_relation(self):
        self.assertIn('x = std::min<int>(a, b) >= c;', changes('x = std::min<int>(a, b) < c;'))
        self.assertEqual(changes('std::array<std::array<int, 3>, 4> x;'), set())

    def test_code_of_other_processors_stays(self):
        text = '#ifdef __ARM\na = 1;\n#else\nb = 2;\n#endif\n#ifndef __ARM\nc = 3;\n#endif\n'
        self.assertEqual({m.line for m in mutate.mutants_of('toy.hpp', text)}, {'b = 2;', 'c = 3;'})
        self.assertIn('a = 1;', {m.line for m in mutate.mutants_of('toy.hpp', text, ['__ARM'])})

    def test_blocks_that_only_a_target_runs_stay(self):
        text = 'void f() {\n  mask_interrupts();\n  if (a) b = 1;\n}\nvoid g() {\n  c = 1;\n}\n'
        self.assertEqual({m.line for m in mutate.mutants_of('toy.hpp', text)}, {'c = 1;'})

    def test_a_mutant_is_named_by_its_line_wherever_that_stands(self):
        text = 'void f() {\n  a = 1;\n  b = 2;\n  a = 1;\n}\n'
        before = {m.key for m in mutate.mutants_of('toy.hpp', text)}
        after = {m.key for m in mutate.mutants_of('toy.hpp', '// more\n\n' + text)}
        self.assertEqual(before, after)
        self.assertIn(('toy.hpp', 'a = 1;', 'a = 2;', 2), before)

    def test_applying_changes_one_place(self):
        text = 'int f(int a) { return a + 1; }\n'
        for mutant in mutate.mutants_of('toy.hpp', text):
            self.assertEqual(mutant.apply(text).strip(), mutant.becomes)


HEADER = '''#pragma once
namespace toy {
constexpr int limit = 10;
constexpr int doubled = 2 * limit;
/// The larger of x and limit: at x == limit both are the same.
inline int at_least(int x) {
  if (x < limit) return limit;
  return x;
}
inline void count(int& n, int to) {
  n = 0;
  while (n < to) n += 1;
}
}  // namespace toy
'''
TEST = '''#include "model/toy.hpp"
static_assert(toy::doubled == 20);
int main() {
  int n = 0;
  toy::count(n, 3);
  return toy::at_least(12) == 12 && toy::at_least(3) == toy::limit && toy::at_least(10) == 10 && n == 3 ? 0 : 1;
}
'''


class Judge(unittest.TestCase):
    """A project of one header and one test."""

    @contextlib.contextmanager
    def project(self, test=TEST):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name, text in (('model/toy.hpp', HEADER), ('model/other.hpp', 'int a = 1;\n'), ('tests/toy.cpp', test)):
                (root / name).parent.mkdir(exist_ok=True)
                (root / name).write_text(text)
            settings = mutants.Settings([programs.Program('toy', ('tests/toy.cpp',), optimise=0)], [], ['model', 'tests'],
                                        ['cstdint'])
            yield mutants.Judge(root, settings, root / 'work', 0, False), root

    def verdict(self, judge, line, becomes, file='model/toy.hpp'):
        mutant = next(m for m in mutate.mutants_of(file, judge.tree.text(file)) if (m.line, m.becomes) == (line, becomes))
        return judge.judge(mutant)

    def test_verdicts(self):
        short = programs.LEAST_TIME_S
        programs.LEAST_TIME_S = 1
        with self.project() as (judge, root):
            def result(line, becomes, file='model/toy.hpp'):
                return self.verdict(judge, line, becomes, file)
            planted = result('if (x < limit) return limit;', 'if (x >= limit) return limit;')
            self.assertEqual((planted['result'], planted['by']), ('killed', 'toy'))
            equivalent = result('if (x < limit) return limit;', 'if (x <= limit) return limit;')
            self.assertEqual(equivalent['result'], 'survived')
            asserted = result('constexpr int doubled = 2 * limit;', 'constexpr int doubled = 3 * limit;')
            self.assertEqual(asserted['result'], 'killed')
            self.assertIn('static assertion failed', asserted['why'])
            endless = result('while (n < to) n += 1;', 'while (n < to) n += 0;')
            self.assertEqual((endless['result'], endless['why']), ('killed', programs.OUT_OF_TIME))
            self.assertEqual(result('int a = 1;', 'int a = 2;', 'model/other.hpp')['result'], 'unseen')
            self.assertEqual((judge.tree.root / 'model/toy.hpp').read_text(), HEADER)
            self.assertEqual((root / 'model/toy.hpp').read_text(), HEADER)
        programs.LEAST_TIME_S = short

    def test_a_loop_without_an_end_in_the_compiler_is_a_failed_check(self):
        header = 'constexpr int count() {\n  int n = 0;\n  while (n < 3) n += 1;\n  return n;\n}\n'
        with self.project('#include "model/toy.hpp"\nconstexpr int n = count();\nint main() { return n - 3; }\n') as (judge, _):
            judge.tree._write('model/toy.hpp', header)
            endless = self.verdict(judge, 'while (n < 3) n += 1;', 'while (n < 3) n += 0;')
            self.assertEqual(endless['result'], 'killed')
            self.assertIn('loop iteration', endless['why'])

    def test_what_no_quick_program_sees_is_undecided_in_a_quick_run(self):
        change = ('if (x < limit) return limit;', 'if (x >= limit) return limit;')
        with self.project() as (judge, _):
            judge.settings.programs[0] = dataclasses.replace(judge.settings.programs[0], slow=True)
            judge.quick = True
            self.assertEqual(self.verdict(judge, *change)['result'], 'undecided')
            judge.quick = False
            self.assertEqual(self.verdict(judge, *change)['result'], 'killed')

    def test_after_the_deadline_nothing_begins(self):
        with self.project() as (judge, _):
            mutant = mutate.mutants_of('model/toy.hpp', HEADER)[0]
            self.assertEqual(judge.judge(mutant, deadline=0)['result'], 'undecided')

    def test_many_mutants_in_one_build(self):
        short, together.LEAST_TIME_S = together.LEAST_TIME_S, 1
        with self.project() as (judge, _):
            listed = mutate.mutants_of('model/toy.hpp', HEADER)
            judging = together.Together(judge.tree, listed, lambda text: None)
            killed = {listed[n].becomes: (by, why) for n, by, why in judging.judge(judge.settings.programs)}
            self.assertEqual(killed['if (x >= limit) return limit;'], ('toy', 'status 1'))
            self.assertEqual(killed['while (n < to) n += 0;'], ('toy', programs.OUT_OF_TIME))
            self.assertNotIn('if (x <= limit) return limit;', killed)
            passed = {listed[n].becomes for n in judging.passed}
            self.assertIn('if (x <= limit) return limit;', passed)
            # What only the compiler computes has no switch that shows.
            self.assertNotIn('constexpr int doubled = 3 * limit;', passed | set(killed))
        together.LEAST_TIME_S = short

    # The switch makes a double of what was an int: the compiler complains of the caller, where no mutant is.
    TYPES = '''#pragma once
namespace toy {
struct Coins {
  int n;
};
constexpr int operator+(Coins a, Coins b) { return a.n + b.n; }
constexpr double operator-(Coins a, Coins b) { return a.n - b.n; }
constexpr auto together(Coins a, Coins b) { return a + b; }
}  // namespace toy
'''

    def test_a_switch_that_breaks_the_build_is_taken_out(self):
        test = ('#include "model/toy.hpp"\nint main(int n, char**) {\n'
                '  return toy::together({n}, {5}) % 7 == 6 ? 0 : 1;\n}\n')
        with self.project(test) as (judge, _):
            judge.tree._write('model/toy.hpp', self.TYPES)
            listed = mutate.mutants_of('model/toy.hpp', self.TYPES)
            breaking = next(n for n, m in enumerate(listed) if 'together' in m.line and 'a - b' in m.becomes)
            told = []
            judging = together.Together(judge.tree, listed, told.append)
            killed = {n for n, _, _ in judging.judge(judge.settings.programs)}
            self.assertEqual(judging.out, {breaking})
            self.assertIn('by halving', told[0])
            self.assertIn('constexpr int operator+(Coins a, Coins b) { return a.n - b.n; }',
                          {listed[n].becomes for n in killed})

    def test_a_program_that_fails_with_all_switches_off_is_left_to_the_ordinary_way(self):
        for test in (TEST.replace('n == 3', 'n == 4'), TEST.replace('n == 3', 'm == 3')):
            with self.project(test) as (judge, _):
                listed, told = mutate.mutants_of('model/toy.hpp', HEADER), []
                judging = together.Together(judge.tree, listed, told.append)
                self.assertEqual(list(judging.judge(judge.settings.programs)), [])
                self.assertIn('with all switches off', told[-1])
                self.assertEqual(set(judging.not_asked), set(range(len(listed))) - judging.out)

    def test_the_first_of_many_messages_is_kept_where_asked_for(self):
        command = [sys.executable, '-c', 'print("first"); print("x" * 30_000)']
        self.assertIn('first', programs.run_limited(command, '.', 10, kept=together.KEPT_OUTPUT)[1])
        self.assertEqual(len(programs.run_limited(command, '.', 10)[1]), programs.KEPT_OUTPUT)

    def test_in_switched_text_every_line_stays_where_it_was(self):
        text = ('int f(int a, int b) {\n  if (a < b) return a;\n  while (a > b)\n    a -= b;\n'
                '  return g(a ? 1 : b + 2);\n}\n')
        listed = list(enumerate(mutate.mutants_of('toy.hpp', text)))
        switched, lines, left_out = together.switched(text, listed)
        self.assertEqual(left_out, set())
        self.assertEqual(switched.count('\n'), text.count('\n'))
        for number, mutant in listed:
            self.assertIn(number, lines[mutant.line_number])
        self.assertIn('{ if (!(', switched)

    def test_switches_that_are_off_change_nothing(self):
        text = 'void f() {\n  a += b *= c / d;\n}\n'
        listed = [(n, m) for n, m in enumerate(mutate.mutants_of('toy.hpp', text)) if m.operator == 'assignment']
        self.assertEqual([m.becomes for _, m in listed], ['a -= b *= c / d;', 'a += b += c / d;'])
        line = together.switched(text, listed)[0].split('\n')[1].strip()
        self.assertEqual(line.replace('fxdyn_mutants::', ''),
                         '(on(1) ? (a -= b *= c / d) : (a += (on(2) ? (b += c / d) : (b *= c / d))));')

    def test_after_the_deadline_nothing_more_is_asked(self):
        with self.project() as (judge, _):
            listed = mutate.mutants_of('model/toy.hpp', HEADER)
            judging = together.Together(judge.tree, listed, lambda text: None)
            self.assertEqual(list(judging.judge(judge.settings.programs, deadline=0)), [])
            self.assertEqual(set(judging.not_asked), set(range(len(listed))) - judging.out)

    def test_what_is_no_program_is_no_kill(self):
        with self.project() as (judge, _):
            mutant = mutate.Mutant('model/toy.hpp', 'toy', HEADER.index('int x'), HEADER.index('int x') + 5, '', 1, '', '', 1)
            self.assertEqual(judge.judge(mutant)['result'], 'invalid')

    def test_a_test_that_fails_anyway_kills_nothing(self):
        with self.project(TEST.replace('n == 3', 'n == 4')) as (judge, _):
            with self.assertRaisesRegex(RuntimeError, 'fails without any change'):
                judge.judge(mutate.mutants_of('model/toy.hpp', HEADER)[0])

    def test_the_same_seed_draws_the_same(self):
        with self.project() as (_, root):
            def keys(seed):
                return [m.key for m in mutants.drawn(['model/toy.hpp', 'model/other.hpp'], seed, root)]
            self.assertEqual(keys(1), keys(1))
            self.assertNotEqual(keys(1), keys(2))
            self.assertEqual(set(keys(1)), set(keys(2)))
            self.assertEqual(len(keys(1)), len(set(keys(1))))


class Lists(unittest.TestCase):
    def test_lines_of_a_diff(self):
        diff = ('diff --git a/model/a.hpp b/model/a.hpp\n--- a/model/a.hpp\n+++ b/model/a.hpp\n@@ -1,2 +1,3 @@\n'
                '@@ -9 +10 @@ x\n@@ -20,2 +21,0 @@\n--- a/gone.hpp\n+++ /dev/null\n@@ -1 +0,0 @@\n')
        self.assertEqual(mutants.lines_of_diff(diff), {'model/a.hpp': {1, 2, 3, 10}})

    def test_reasons_count_and_survivors_without_one_are_found(self):
        mutant = mutate.Mutant('model/toy.hpp', 'number', 0, 1, '', 7, 'a = 1;', 'a = 2;', 1)
        results = [(mutant, {'result': 'survived', 'by': '', 'why': '', 'seconds': 1})]
        self.assertEqual(mutants.without_reason(results, {}), [mutant])
        self.assertEqual(mutants.without_reason(results, {mutant.key: 'the same'}), [])
        settings = mutants.Settings([], [], [], [])
        self.assertIn('no reason', mutants.report('toy', results, {}, settings))
        text = mutants.report('toy', results, {mutant.key: 'the same'}, settings)
        self.assertIn('model/toy.hpp:7 (number)\n```diff\n- a = 1;\n+ a = 2;\n```\nthe same', text)
        self.assertIn('| model | 1 | 0 (0.0 %) | 0 | 0 | 1 | 1 | 0 | 0 |', text)

    def test_a_known_edit_has_to_stand_exactly_once(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / 'toy.hpp').write_text('a = 1;\nb = 1;\n')
            known = root / 'known.toml'
            entry = '[[known]]\nname = "toy"\nedits = [{{ file = "toy.hpp", pattern = \'{}\', becomes = "{}" }}]\n'
            known.write_text(entry.format('a = 1', 'a = 2'))
            (mutant,), complaints = mutants.load_known(known, root)
            self.assertEqual((mutant.apply('a = 1;\nb = 1;\n'), complaints), ('a = 2;\nb = 1;\n', []))
            for pattern in ('c', '= 1'):
                known.write_text(entry.format(pattern, ''))
                self.assertEqual(len(mutants.load_known(known, root)[1]), 1)

    def test_every_program_and_file_is_there_and_every_test_is_used(self):
        settings = mutants.Settings.load(mutants.HERE / 'programs.toml')
        for program in settings.programs:
            for source in program.sources:
                self.assertTrue((mutants.PROJECT / source).is_file(), source)
        used = {source for program in settings.programs for source in program.sources} | set(settings.not_used)
        for folder in mutants.FOLDERS:
            for path in (mutants.PROJECT / 'tests' / folder).glob('*.cpp'):
                self.assertIn(str(path.relative_to(mutants.PROJECT)), used, 'a program in programs.toml is missing')
        for entry in settings.left_out:
            for pattern in entry['files']:
                self.assertTrue(list(mutants.PROJECT.glob(pattern)), pattern)


if __name__ == '__main__':
    unittest.main()
