#!/usr/bin/env python3
"""toolchains/stack_bound.py on call graphs made up for the purpose."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / 'toolchains' / 'stack_bound.py'


def node(name, size, kind='static'):
    return f'node: {{ title: "{name}" label: "{name}\\nmain.cpp:1:1\\n{size} bytes ({kind})\\n0 dynamic objects" }}\n'


def edge(source, target):
    return f'edge: {{ sourcename: "{source}" targetname: "{target}" label: "main.cpp:1:1" }}\n'


class StackBound(unittest.TestCase):
    def run_on(self, graph, disassembly='', *more):
        with tempfile.TemporaryDirectory() as folder:
            (pathlib.Path(folder) / 'main.ci').write_text(graph)
            (pathlib.Path(folder) / 'code.txt').write_text(disassembly)
            return subprocess.run([sys.executable, SCRIPT, '--ci', folder, '--disassembly', folder + '/code.txt',
                                   *(more or ('--root', 'main'))], capture_output=True, text=True)

    def accepted(self, expected, *arguments):
        done = self.run_on(*arguments)
        self.assertEqual((done.returncode, done.stdout.strip()), (0, str(expected)), done.stderr)

    def refused(self, message, *arguments):
        done = self.run_on(*arguments)
        self.assertEqual(done.returncode, 1)
        self.assertIn(message, done.stderr)

    def test_a_label_that_is_no_function_does_not_mislead(self):
        # an absolute symbol whose value happens to lie within the function
        code = '00000100 <main>:\n 100:\tbne.n\t10c <some_size+0xc>\n 10c:\tbx\tlr\n'
        self.accepted(16, node('main', 16), code)

    def test_the_deepest_path_counts(self):
        graph = node('main', 16) + node('a', 100) + node('b', 8) + node('c', 120) + edge('main', 'a') + edge(
            'main', 'b') + edge('b', 'c')
        self.accepted(16 + 8 + 120, graph)

    def test_an_interrupt_comes_on_top(self):
        self.accepted(16 + 108 + 24, node('main', 16) + node('handler', 24), '', '--root', 'main', 'handler')

    def test_more_than_there_is(self):
        self.refused('16 bytes may be needed', node('main', 16), '', '--root', 'main', '--limit', '15')

    def test_local_names_carry_their_file(self):
        self.accepted(24, node('main', 16) + node('main.cpp:local', 8) + edge('main', 'main.cpp:local'))

    def test_recursion(self):
        self.refused('recursion: a -> b -> a', node('main', 16) + node('a', 8) + node('b', 8) + edge('main', 'a') +
                     edge('a', 'b') + edge('b', 'a'))

    def test_indirect_call(self):
        self.refused('main: indirect call', node('main', 16) + edge('main', '__indirect_call'))
        self.refused('main: indirect call', node('main', 16), '00000000 <main>:\n   0:\tblx\tr3\n')

    def test_unknown_function(self):
        self.refused('unknown function memcpy, called from main', node('main', 16) + edge('main', 'memcpy'))

    def test_frame_of_unknown_size(self):
        self.refused('unknown size', node('main', 16, 'dynamic'))

    def test_library_functions_are_read_off_their_code(self):
        code = ('00000000 <main>:\n   0:\tbl\t10 <__aeabi_lmul>\n\n'
                '10000010 <__aeabi_lmul>:\n10000010:\tpush\t{r4, r6-r8, lr}\n10000012:\tsub\tsp, #12\n'
                '10000014:\tb.n\t10000020 <tail>\n\n'
                '10000020 <tail>:\n10000020:\tstmdb\tsp!, {r4, r5}\n10000022:\tbx\tlr\n')
        self.accepted(16 + 20 + 12 + 8, node('main', 16), code)
        self.refused('recursion', node('main', 16), '00000000 <main>:\n   0:\tbl\t0 <main>\n')


if __name__ == '__main__':
    unittest.main()
