#!/usr/bin/env python3
"""GrainLearning's hyperbola, one iteration by the package itself: its parameter sets, its noise, its weights.

    pip install grainlearning && python3 hyperbola.py FOLDER

writes into FOLDER what the plan beside this file reads (hyperbola-obs.txt, hyperbola-samples.txt) and what it is compared
with (hyperbola-weights.txt). The files beside this one were made so, with version 2.0.5.
"""

import pathlib
import sys

import numpy as np
from grainlearning import BayesianCalibration
from grainlearning.tools import write_dict_to_file, write_to_table

folder = pathlib.Path(sys.argv[1])
strain = np.arange(100)
stress = strain / (0.2 * 100 + 5.0 * strain)


def simulate(calibration):
    sets = calibration.system.param_data
    calibration.system.set_sim_data([np.array(strain / (a * 100 + b * strain), ndmin=2) for a, b in sets])


calibration = BayesianCalibration.from_dict(
    {
        "num_iter": 1,
        "callback": simulate,
        "save_fig": -1,
        "system": {
            "param_names": ["a", "b"],
            "param_min": [0.001, 0.001],
            "param_max": [1, 10],
            "num_samples": 20,
            "obs_names": ["f"],
            "ctrl_name": "u",
            "obs_data": stress,
            "ctrl_data": strain,
            "sim_name": "hyperbola",
        },
        "inference": {
            "Bayes_filter": {"ess_target": 0.3, "scale_cov_with_max": True},
            "sampling": {"max_num_components": 1, "n_init": 1, "random_state": 0},
            "initial_sampling": "halton",
        },
    }
)
calibration.run()
system = calibration.system
write_dict_to_file({"u": strain.tolist(), "f": stress.tolist()}, folder / "hyperbola-obs.txt")
table = pathlib.Path(write_to_table("hyperbola", system.param_data, system.param_names))
table.rename(folder / "hyperbola-samples.txt")
# Once more with the sets as the table rounds them, and the noise that was found.
system.param_data = np.genfromtxt(folder / "hyperbola-samples.txt", skip_header=1, usecols=(3, 4))
simulate(calibration)
bayes_filter = calibration.inference.Bayes_filter
bayes_filter.data_assimilation_loop(calibration.inference.sigma_list[-1], system)
with open(folder / "hyperbola-weights.txt", "w") as file:
    file.write(f"# sigma {float(np.sqrt(bayes_filter.cov_matrices[0].item()))!r}\n")
    file.writelines(f"{float(weight)!r}\n" for weight in bayes_filter.get_posterior_at_time())
