"""The training worker, but it reports after every epoch, and leaves a snapshot with each report that asks for one."""

from openeureka.executors import child
from openeureka.training import population

population.PROGRESS_SECONDS = 0.0
child.main()
