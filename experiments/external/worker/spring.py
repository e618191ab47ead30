"""A spring as a worker: crates/campaign/docs/worker-protocol.md says what is exchanged."""
import json, sys

for line in sys.stdin:
    request = json.loads(line)
    if "protocol" in request:
        extensions, answer = request["outputs"][0]["at"], {"protocol": 1}
    else:
        k, f0 = request["parameters"]["stiffness"], request["parameters"]["preload"]
        values = {"extension_mm": extensions, "force_n": [f0 + k * x for x in extensions]}
        answer = {"id": request["id"], "values": values}
    print(json.dumps(answer), flush=True)
