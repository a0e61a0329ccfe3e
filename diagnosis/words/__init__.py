"""Every sentence that people read of a diagnosis, written from its document alone as the last step of `diagnose`.

Where a sentence is:

- `verdict`: the answer in a few words and in a paragraph; what nearly explains a gap, springs that may be off,
  further modes, runs in limit cycles.
- `where`: where the gap is, and the reason.
- `remainder`: what remains of the gap, and what could be closed of it.
- `cautions`: caveats, remarks on the noise, notes on coefficients and on a patched model, each under the kind of
  its fact (`diagnosis.facts.found.Fact`).
- `causes`: what a cause does to a swing.
- `next_steps`: what to do next, and the run to make.
- `lines` and `tables`: what is printed around and below them.
- `answers`: their order, and what the one is called that is set out.
- `numbers` and `names`: how numbers, effects and channels are written in all of these.

`written.sentences` composes the text fields of a document. The other rooms return facts.
"""
