"""Curves of a STEP or BREP file, read by Open CASCADE in a separate process, which a damaged file may crash.

    python3 cad_process.py FILE step|brep SECONDS

It imports nothing of formingx. It prints one line of JSON: {"curves": {number: [lowest, highest parameter]}} or
{"error": message}. Then it reads lines [number, [parameters]] and answers each by [points, derivatives] or an error.
"""

import json
import os
import resource
import sys


def main(file: str, kind: str, seconds: int) -> None:
    """Read the file, print its curves, then answer requests for points of the curves, until standard input ends.

    A request is a JSON line [curve, [parameters]], its answer [coordinates, derivatives]. The system ends the process
    after `seconds` of processor time.
    """
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)                                           # hides the output of the libraries
    try:
        import gmsh
    except (ImportError, OSError) as error:
        out.write(json.dumps({"error": f"it needs gmsh, which cannot be imported: {error}: install it by \"pip install"
                                       " 'formingx[cad]'\", and the libraries of the system that it names"}) + "\n")
        return
    gmsh.initialize([], readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    model = gmsh.model
    model.add("formingx tool")
    try:
        model.occ.importShapes(file, highestDimOnly=False, format=kind)
        model.occ.synchronize()
        bounds = {tag: [float(end[0]) for end in model.getParametrizationBounds(1, tag)]
                  for _, tag in model.getEntities(1)}
        out.write(json.dumps({"curves": bounds}) + "\n")
    except Exception as error:  # noqa: BLE001  any error of the reader on a damaged file
        out.write(json.dumps({"error": str(error)}) + "\n")
        return
    for line in sys.stdin:
        tag, parameters = json.loads(line)
        try:
            answer = [list(model.getValue(1, tag, parameters)), list(model.getDerivative(1, tag, parameters))]
            out.write(json.dumps(answer) + "\n")
        except Exception as error:  # noqa: BLE001
            out.write(json.dumps({"error": str(error)}) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
