"""Files of records, to which scripts add lines."""

import records


def test_a_record_goes_on_after_a_line_that_was_cut_off(tmp_path):
    file = tmp_path / "walks.jsonl"
    records.append(file, [{"speed": 0.25}])
    file.write_text(file.read_text() + '{"speed": 0.')
    records.append(file, [{"speed": 0.5}])
    assert records.read(file) == [{"speed": 0.25}, {"speed": 0.5}]
