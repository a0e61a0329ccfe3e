"""Sweeps: the product of rigs, conditions, sensors, truths and effects, simulated, estimated and stored.

`schema` defines the sweep file, `product` lists its cases, `shard` does the work of a few cases, `store` keeps
finished shards, `processes` and `cluster` do shards in parallel, and `engine` combines these; `summary` and
`figures` present the results. Nothing heavy is imported here, because workers start with this module.
"""
