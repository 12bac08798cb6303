"""The training worker, but it reports after every epoch, and so may leave a snapshot after every epoch."""

from openeureka.executors import child
from openeureka.training import population

population.PROGRESS_SECONDS = 0.0
child.main()
