"""The spring as a model of UM-Bridge, behind HTTP: python3 umbridge-model.py [PORT]"""
import sys
import umbridge


class Spring(umbridge.Model):
    def __init__(self):
        super().__init__("spring")

    def get_input_sizes(self, config):
        return [2]

    def get_output_sizes(self, config):
        return [len(at) for at in config.get("at", [[]])]

    def __call__(self, parameters, config):
        stiffness, preload = parameters[0]
        return [[preload + stiffness * x for x in at] for at in config["at"]]

    def supports_evaluate(self):
        return True


umbridge.serve_models([Spring()], int(sys.argv[1]) if len(sys.argv) > 1 else 4242)
