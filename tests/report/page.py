"""A page as a person reads it."""

import html
import re


def words(page: str) -> str:
    """The text of a page: a table's row is a line, `| cell | cell |`."""
    page = re.sub(r"<(style|script)>.*?</\1>", "", page, flags=re.DOTALL)
    page = re.sub(r"\s*</t[dh]>\s*<t[dh][^>]*>", " | ", page)
    page = re.sub(r"<tr[^>]*>\s*<t[dh][^>]*>", "| ", page)
    page = re.sub(r"</t[dh]>\s*</tr>", " |\n", page)
    return html.unescape(re.sub(r"<[^>]+>", "", page))
