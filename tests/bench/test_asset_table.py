"""The table of files keeps what was written by hand."""

from relume_bench.asset_table import BEGIN, END, filled


def test_worst_files_come_first_and_reasons_are_kept() -> None:
    good = {"rmse": 0.021, "bias": -0.004, "flip": 0.0123, "p99": 0.05}
    by_file = {"a.glb": good, "b.obj": {**good, "rmse": 0.2}, "c.ply": {"error": "ValueError: a | b"}}
    text = filled(f"before\n{BEGIN}\n{END}\nafter\n", by_file)
    lines = text.splitlines()
    assert [line.split("`")[1] for line in lines if line.startswith("| `")] == ["b.obj", "a.glb", "c.ply"]
    assert "| `a.glb` | 2.1 % | -0.4 % | 0.012 | 0.050 |  |" in lines
    assert "| `c.ply` |  |  |  |  | failed: ValueError: a / b |" in lines
    explained = text.replace(
        "| 20.0 % | -0.4 % | 0.012 | 0.050 |  |", "| 20.0 % | -0.4 % | 0.012 | 0.050 | Caustics. |"
    )
    assert filled(explained, by_file) == explained
    assert "| 0.050 | Caustics. |" in filled(explained, {**by_file, "b.obj": {**good, "rmse": 0.3}})
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
