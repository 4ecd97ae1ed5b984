"""The script of the planned rover: it continues after an interruption, and writes its page."""

import shutil

import planning


def test_the_page_is_made_from_the_records(tmp_path):
    shutil.copy(planning.HERE / planning.RECORDS, tmp_path)
    planning.write_page(tmp_path, planning.all_episodes())
    made, recorded = (folder / "README.md" for folder in (tmp_path, planning.HERE))
    assert made.read_text("utf-8") == recorded.read_text("utf-8")
