"""Tables whose heads and rows can be picked."""

from nerfnav_app.page.kit.data_table import Column, Row, Text, data_table
from nerfnav_app.page.kit.theme import HIT, readable

_HEAD = (Column((Text("Name", pick="sort:name"), Text("Place"))), Column((Text("Error"),), number=True))


def test_rows_and_heads_name_the_widget_and_the_value_that_a_click_sets() -> None:
    rows = [Row(((Text("one"), Text("hall")), (Text("3 cm", HIT),)), "first", picked=True, hover="over:first")]
    html = data_table(_HEAD, rows, "widget-7")
    assert 'data-pick="widget-7" data-value="sort:name"' in html
    assert '<tr data-pick="widget-7" data-value="first" tabindex="0" data-hover="over:first"' in html
    assert "one</span><br><span>hall" in html and readable(HIT) in html
    assert html.count('class="picked"') == 1 and html.count('class="number"') == 2


def test_names_from_data_are_escaped_in_texts_and_values() -> None:
    name = '"><script>'
    html = data_table(_HEAD, [Row(((Text(name),), (Text("1"),)), pick=name)], "w")
    assert "<script>" not in html and html.count("&lt;script&gt;") == 2
