"""The paper's CECI, Computation of Expectation based on Correlation Information, as it is written.

- `masked_graphs`: pairs of histograms E′ × O′ and E × O as graphs (sections II and III-B).
- `gcn`: the network, five blocks of graph convolution (section III-A).
- `network`: its loss (section IV-A), and the expectation E″ × O″ that it predicts (section III-C).

`bsg_models.training.epochs` takes the steps; `bsg_models.belief.belief_graph` adds blind nodes.
"""
