"""All sentences about a diagnosis, written from its document alone.

The modules:

- `verdict`: the answer in a few words and in a paragraph; near explanations of a gap, springs that may be off,
  further modes, runs in limit cycles.
- `where`: the place of the gap, and the reason.
- `remainder`: the remaining gap, and the part of it that could be explained.
- `cautions`: caveats, remarks on the noise, notes on coefficients and on a patched model, each under the kind of
  its fact (`diagnosis.facts.found.Fact`).
- `causes`: the effect of a cause on a swing.
- `next_steps`: what to do next, and the run to make.
- `lines` and `tables`: the text printed around and below them.
- `answers`: their order, and the name of the answer that is set out.
- `numbers` and `names`: the format of numbers, effects and channels in all of these.

`written.sentences` composes the text fields of a document. The other rooms return facts.
"""
