"""Sweeps: the product of rigs, conditions, sensors, truths and effects, simulated, estimated and kept.

`schema` says what a sweep file holds, `product` which cases it stands for, `shard` does the work of a few cases,
`store` keeps what is finished, `processes` and `cluster` do shards side by side, `engine` ties these together;
`summary` and `figures` draw what people look at. Nothing heavy is imported here: workers start by this module.
"""
