"""Writes docs/blind.md from stored runs of `rig blind --json`.

    python bench/blind_page.py RUN.json [WITHHELD.json MUJOCO.json ...] > docs/blind.md

Definitions first, then every run's tables as they are, in the order given.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rig.blind.text import markdown

DEFINITIONS = """\
# The blind check

`rig blind` draws measurements with hidden effects, writes each as an ordinary HDF5 data set, has it diagnosed in another process that is given
the path and nothing else, then opens the answers and scores. The generator shares no code with `identification`. Everything on this page is
simulated; the labelled and real cases that the diagnosis was developed with are not among these.
Earlier runs, and test sets that were written independently: [blind_history.md](blind_history.md). Each section below begins with the command that repeats it.

## What the figures mean

A case holds one effect, two (a mixture), none, or something outside the vocabulary (`unknown`). Its **gap over noise** is the rms of what the best
six springs within three stated standard deviations leave of the noise-free displacement, over the rms of what is random in it. Figures count cases
with at least `--snr-min` (3), and those without an effect; the table by size counts all. With an arm every seventh hand turns past some levels, and
back, before anything is read (`turned_past` in the answers).

| term | definition |
| --- | --- |
| right | the verdict is among the words that the answers accept: the true one, and those that explain these data as well |
| right or in the set | right, or a true word stands in the verdict's `indistinguishable_from` |
| exact | the verdict is the true word; of two effects, the one that alone makes the larger gap |
| withheld | `--withhold WORD`: the word is taken out of the library and drawn in every second case; then `unknown` is right, and so is a word that explains the case without it. Recall and AUROC of `unknown` count only cases without such a word |
| false alarm | a case without effect that is not called `none` |
| unknown: AUROC | probability that a case outside the library gets a larger p(unknown) than a known effect; ties count half |
| two effects: F1 | pooled over the mixtures; an effect is hit by a found word that the answers accept for it, each once |
| ECE, reliability | the verdict's probability against *exact*, ten bins of equal width; an accepted stand-in does not count here, since the probability is that of the word |
| ECE by chance | the same error of as many verdicts whose probabilities are exactly right: its mean, and what it exceeds once in twenty times; bins of a few cases are off by chance |
| Brier | verdict: mean of (p - exact)^2; all words: mean over the cases of the sum of (p_word - 1 if true)^2 |
| intervals | parameters that answers and diagnosis define alike, of effects found under their own word; the 90 % interval as the diagnosis gives it (`ci90`) |
| where | of single effects named exactly: the joints are the true ones, the direction with the largest gap is named, the same directions are named (those with 15 % of the largest), the encoders' view is right |
| fitted, withheld / noise | rms that the explanation leaves, on the data it was fitted to and on the first kind of withheld data, over the noise as the generator made it; cases with known effects and with none |
| beats wrong runners-up | of effects named exactly: the share of other words, not accepted, that leave more on withheld data |
| law | `fitted`: the library contains the form nearly exactly; `foreign`: it does not |
| crashed, refused or late | no answer within the deadline (120 s); counts as wrong everywhere |

Intervals beside rates are Wilson's, 95 %. `met` compares the figure itself with what is aimed at.
"""  # noqa: E501


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    args = parser.parse_args()
    parts = [DEFINITIONS]
    for path in args.runs:
        report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        parts.append(f"## {_title(report)}\n\n{markdown(report, level=3)}\n")
    print("\n".join(parts), end="")


def _title(report: dict[str, Any]) -> str:
    out = f"{report['cases_done']} cases, generator {report['generator']}, seed {report['seed']}"
    if report["withhold"] == "each":
        return out + ", each word withheld in turn"
    return out + (f", {report['withhold']} withheld" if report["withhold"] else "")


if __name__ == "__main__":
    main()
