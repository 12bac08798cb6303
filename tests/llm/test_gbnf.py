from random import Random

import pytest

from openeureka.llm import gbnf

TEXT = r"""root ::= " a" pair{2,3} "\n"
pair ::= "\"" [a-c] "\"" | other
other ::= "-"
"""


def test_rendering_what_was_parsed_gives_it_back():
    assert gbnf.render(gbnf.parse(TEXT)) == TEXT


def test_comments_and_empty_lines_are_skipped():
    assert gbnf.render(gbnf.parse(f"# why\n\n{TEXT}")) == TEXT


@pytest.mark.parametrize("text", ["no rule", 'root ::= "open', "root ::= (a | b)", "root ::= a?"])
def test_notation_beyond_the_subset_is_refused(text: str):
    with pytest.raises(ValueError, match="not"):
        gbnf.parse(text)


def test_pruning_drops_what_derives_nothing_and_what_nothing_uses():
    grammar = gbnf.parse('root ::= kept | dead "x"\ndead ::= missing\nkept ::= "k" | missing\nloose ::= "l"')
    assert gbnf.render(gbnf.prune(grammar)) == 'root ::= kept\nkept ::= "k"\n'


def test_derivation_is_a_function_of_the_seed_and_stays_in_the_language():
    grammar = gbnf.parse(TEXT)
    drawn = {gbnf.derive(grammar, Random(seed)) for seed in range(300)}
    assert drawn == {gbnf.derive(grammar, Random(seed)) for seed in range(300)}
    pairs = ['"a"', '"b"', '"c"', "-"]
    two = {f" a{x}{y}\n" for x in pairs for y in pairs}
    assert drawn <= two | {f" a{x}{y}{z}\n" for x in pairs for y in pairs for z in pairs}
    assert two & drawn and drawn - two  # two and three repetitions both occur


def test_repeated_characters_are_drawn_at_their_shortest():
    assert len(gbnf.derive(gbnf.parse("root ::= [a-z_]{3,40}"), Random(0))) == 3
