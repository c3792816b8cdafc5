#!/usr/bin/env python3
"""The script of the pages: it complains where it has to, and nowhere else."""
import pathlib
import tempfile
import unittest

import docs

LONG = 'Word ' + ' '.join(['word'] * 25) + '.'
FINE = 'Word ' + ' '.join(['word'] * 24) + '.'


class Tree(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / 'docs/guide').mkdir(parents=True)
        (self.root / 'docs/decisions').mkdir()

    def page(self, name, text):
        (self.root / name).write_text(text)

    def complaints(self, check):
        return list(docs.CHECKS[check](self.root))


class Words(Tree):
    def test_a_sentence_of_25_words_passes_and_one_more_does_not(self):
        self.page('README.md', f'# A page\n\n{FINE} {FINE}\n')
        self.assertEqual(self.complaints('words'), [])
        self.page('README.md', f'# A page\n\n{FINE} {LONG}\n')
        self.assertEqual(len(self.complaints('words')), 1)
        self.assertIn('README.md:3: 26 words', self.complaints('words')[0])

    def test_a_sentence_goes_on_over_lines_but_not_over_items(self):
        self.page('docs/guide/a.md', LONG.replace(' word word', '\nword word', 1) + '\n')
        self.assertEqual(len(self.complaints('words')), 1)
        half = ' '.join(['word'] * 20)
        self.page('docs/guide/a.md', f'- {half}\n- {half}\n')
        self.assertEqual(self.complaints('words'), [])
        self.page('docs/guide/a.md', f'- {half}\n  {half}\n')
        self.assertEqual(len(self.complaints('words')), 1)

    def test_code_tables_and_headings_are_aside(self):
        self.page('README.md', f'# {LONG}\n\n| {LONG} |\n\n```\n{LONG}\n```\n\n    {LONG}\n\n`{LONG}`\n')
        self.assertEqual(self.complaints('words'), [])

    def test_an_address_counts_nothing_and_a_link_counts_its_text(self):
        self.page('README.md', ' '.join(['word'] * 23) + ' [two words](a/b/c.md#x).\n')
        self.assertEqual(self.complaints('words'), [])
        self.page('README.md', ' '.join(['word'] * 24) + ' [two words](a/b/c.md#x).\n')
        self.assertEqual(len(self.complaints('words')), 1)

    def test_numbers_and_abbreviations_end_no_sentence(self):
        self.page('README.md', ' '.join(['word'] * 13) + ' 0.5 Eq. 3 and ' + ' '.join(['word'] * 12) + '.\n')
        self.assertEqual(len(self.complaints('words')), 1)

    def test_a_phrase_that_nobody_understood_is_found_over_a_line_break(self):
        self.page('docs/guide/a.md', 'Here `windows` alone says\nnothing here.\n')
        self.assertEqual(len(self.complaints('words')), 1)


    def test_a_decision_of_400_words_passes_and_one_more_does_not(self):
        self.page('docs/decisions/1.md', '# A decision\n\n' + ' '.join(['word'] * 400) + '\n')
        self.assertEqual(self.complaints('words'), [])
        self.page('docs/decisions/1.md', '# A decision\n\n' + ' '.join(['word'] * 401) + '\n')
        self.assertEqual(len(self.complaints('words')), 1)


class Links(Tree):
    def test_a_missing_file_and_a_missing_anchor(self):
        self.page('README.md', '[a](docs/guide/a.md) [b](docs/guide/b.md) [c](docs/guide/a.md#two-words) [d](docs/guide/a.md#three)\n')
        self.page('docs/guide/a.md', '# Two `words`\n')
        complaints = self.complaints('links')
        self.assertEqual(len(complaints), 2)
        self.assertIn('b.md: no such file', complaints[0])
        self.assertIn('#three: no such heading', complaints[1])

    def test_links_in_code_are_none(self):
        self.page('README.md', '`[a](no.md)`\n```\n[a](no.md)\n```\n')
        self.assertEqual(self.complaints('links'), [])

    def test_a_page_without_a_link_to_it(self):
        self.page('README.md', '[a](docs/guide/a.md)\n')
        self.page('docs/guide/a.md', '[myself](a.md)\n')
        self.page('docs/decisions/1.md', 'alone\n')
        self.assertEqual(len(self.complaints('links')), 1)
        self.assertIn('docs/decisions/1.md: no page has a link', self.complaints('links')[0])

    def test_a_link_to_itself_is_no_link(self):
        self.page('README.md', 'nothing\n')
        self.page('docs/guide/a.md', '[myself](a.md)\n')
        self.assertEqual(len(self.complaints('links')), 1)

    def test_the_second_heading_of_a_name_is_counted(self):
        self.page('README.md', '# Same\n\n# Same\n\n[first](#same) [second](#same-1)\n')
        self.assertEqual(self.complaints('links'), [])
        self.page('README.md', '# Same\n\n[second](#same-1)\n')
        self.assertEqual(len(self.complaints('links')), 1)


class Spelling(Tree):
    def test_a_misspelt_word_is_found_and_a_term_is_not(self):
        self.page('README.md', 'The colour of presliding. `colur` is code.\n')
        self.assertEqual(self.complaints('spelling'), [])
        self.page('README.md', 'Good.\n\nThe colur.\n')
        self.assertEqual(self.complaints('spelling'),
                         ['README.md:3: "colur" is not spelled so; a term goes into tests/docs/terms.txt'])
        self.page('README.md', 'The color.\n')
        self.assertEqual(len(self.complaints('spelling')), 1)


if __name__ == '__main__':
    unittest.main()
