"""A worker that asks a model behind UM-Bridge's HTTP protocol: python3 umbridge-worker.py URL MODEL

The model gets all parameters as one vector, in the order of the plan, and the observation points as "at" in its
configuration. Each of its output vectors is one observable, in the order of the plan.
"""
import json, sys
import requests, umbridge


def evaluate(theta):
    try:
        vectors = model([theta], {"at": [output["at"] for output in outputs]})
    except requests.exceptions.ConnectionError as error:
        return {"failure": {"code": 75, "message": str(error)}}  # the server is down: later
    except Exception as error:
        return {"failure": {"code": 1, "message": str(error)}}
    values = {output["control"]: output["at"] for output in outputs if output["control"]}
    values.update((output["value"], vector) for output, vector in zip(outputs, vectors))
    return {"values": values}


try:
    model = umbridge.HTTPModel(sys.argv[1], sys.argv[2])
except requests.exceptions.ConnectionError as error:
    print(error, file=sys.stderr)
    sys.exit(75)
for line in sys.stdin:
    request = json.loads(line)
    if "protocol" in request:
        names, outputs, answer = request["parameters"], request["outputs"], {"protocol": 1}
    else:
        answer = {"id": request["id"], **evaluate([request["parameters"][name] for name in names])}
    print(json.dumps(answer), flush=True)
