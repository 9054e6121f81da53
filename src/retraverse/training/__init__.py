"""Training: networks tuned or made from a user's own pictures, each seeded and resumable.

One file a training, each with a frozen dataclass of settings and a function that runs it:
``jpeg_distil`` and ``jpeg_labels`` (networks that do not mind JPEG), ``calc`` (CALC's
autoencoder), ``deepseqslam`` (a network and an LSTM on one drive), ``netvlad`` (clusters and PCA
of a drive). ``trainings`` lists them. What they share: ``loop`` (steps, checkpoints, resuming),
``pictures`` (pictures to batches), ``report`` (the page a training leaves).

Everything here needs the extra ``learned`` and is imported only when something is trained.
"""

__all__: list[str] = []
