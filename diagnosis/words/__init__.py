"""All sentences about a diagnosis, written from its document alone.

The modules:

- `verdict`: the answer in a few words and in a paragraph; near explanations of a gap, springs that may be off,
  further modes, runs in limit cycles; what to do next, and the run to make.
- `where`: the place of the gap, and the reason.
- `remainder`: the remaining gap, and the part of it that could be explained.
- `cautions`: caveats, remarks on the noise, notes on coefficients and on a patched model, each under the kind of
  its fact (`diagnosis.model.fact.Fact`).
- `causes` and `scatter`: the causes and their sizes; how the runs repeat.
- `tables`, `lines`, `cards` and `captions`: the tables, the lines beside them, the head of the report, its figures.
- `sections`: all of these as the blocks that every face shows.
- `answers`, `numbers` and `symbols`: the order of the answers, the format of numbers and names, and symbols.

`written.sentences` composes the text fields of a document. The other rooms return facts.
"""
