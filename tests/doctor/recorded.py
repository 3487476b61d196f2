"""Recordings for tests, in the formats of several programs."""

import struct
import zlib
from pathlib import Path

import numpy as np

from sph_gym.doctor.case import DX, case, lattice


def flow(make, name="dam", every=8):
    """Return the arrays of a short run: x, v (frames, n, 2), rho, p (frames, n), t (frames,)."""
    start, n_steps = CASES[name]()
    solver, found = make(start.copy()), []
    with np.errstate(all="ignore"):
        for step in range(n_steps + 1):
            if step:
                solver.step(start.dt)
            if step % every == 0:
                state = [np.array(getattr(solver, each)) for each in ("x", "v", "rho", "p")]
                found.append([*state, step * start.dt])
    columns = zip(*found, strict=True)
    return dict(zip(("x", "v", "rho", "p", "t"), map(np.array, columns), strict=True))


def _dam():
    x = lattice(10, 10)
    box = (0.0, 20 * DX, 0.0, np.inf)
    options = {"gravity": (0, -9.81), "box": box, "viscosity": 0.005, "xsph": 0.3}
    return case(x - x.min(axis=0) + DX / 2, **options), 240


def _blob():
    return case(lattice(10, 10, 0.96 * DX), v=(0.3, 0.1), xsph=0.3), 160


def _spin():
    x = lattice(10, 10)
    return case(x, v=4 * np.stack([-x[:, 1], x[:, 0]], axis=1), xsph=0.3), 160


CASES = {"dam": _dam, "blob": _blob, "spin": _spin}


def write_partvtk(folder: Path, run, shuffle=True, text=False):
    """Write PartFluid_0000.vtk, ... as PartVTK of DualSPHysics does: a plane flow in x and z."""
    rng = np.random.default_rng(1)
    n = run["x"].shape[1]
    for k in range(len(run["t"])):
        order = rng.permutation(n) if shuffle else np.arange(n)
        x, v = (_xz(run[name][k][order]) for name in "xv")
        path = folder / f"PartFluid_{k:04d}.vtk"
        sections = [
            ("POINTS {n} float", x, "f4"),
            ("VERTICES {n} {2n}", np.stack([np.ones(n), np.arange(n)], axis=1), "i4"),
            ("POINT_DATA {n}\nSCALARS Idp unsigned_int\nLOOKUP_TABLE default", order, "u4"),
            ("VECTORS Vel float", v, "f4"),
            ("SCALARS Rhop float\nLOOKUP_TABLE default", run["rho"][k][order], "f4"),
            ("SCALARS Press float\nLOOKUP_TABLE default", run["p"][k][order], "f4"),
        ]
        with path.open("wb") as file:
            form = b"ASCII" if text else b"BINARY"
            file.write(b"# vtk DataFile Version 3.0\nPartVTK\n" + form + b"\nDATASET POLYDATA\n")
            for heading, values, kind in sections:
                heading = heading.replace("{n}", str(n)).replace("{2n}", str(2 * n))
                file.write(heading.encode() + b"\n" + _numbers(values, kind, text) + b"\n")


def _xz(values):
    return np.stack([values[:, 0], np.zeros(len(values)), values[:, 1]], axis=1)


def _numbers(values, kind, text):
    values = np.asarray(values).astype(kind)
    if text:
        return "\n".join(
            " ".join(map(repr, row.tolist())) for row in np.atleast_2d(values)
        ).encode()
    return values.astype(np.dtype(kind).newbyteorder(">")).tobytes()


def write_partvtk_csv(folder: Path, run):
    """Write PartFluid_0000.csv, ... as PartVTK of DualSPHysics does, with all of its preamble."""
    heading = "Pos.x [m];Pos.y [m];Pos.z [m];Idp;Vel.x [m/s];Vel.y [m/s];Vel.z [m/s];"
    heading += "Rhop [kg/m^3];Press [Pa];Type;"
    n = run["x"].shape[1]
    for k, t in enumerate(run["t"]):
        x, v = (_xz(run[name][k]) for name in "xv")
        lines = ["TimeStep [s];Np;Nbound;Nfluid", f"{float(t)!r};{n};0;{n}", "", heading]
        for i in range(n):
            row = [*x[i], i, *v[i], run["rho"][k][i], run["p"][k][i], 3]
            lines.append(";".join(repr(float(each)) for each in row) + ";")
        (folder / f"PartFluid_{k:04d}.csv").write_text("\n".join(lines))


def write_pysph(folder: Path, run, suffix=".hdf5", every=10, wall=None):
    """Write flow_0.hdf5, flow_10.hdf5, ... or .npz as PySPH does."""
    for k, t in enumerate(run["t"]):
        materials = {"fluid": _pysph_columns(*(run[name][k] for name in ("x", "v", "rho", "p")))}
        if wall is not None:
            m = len(wall)
            materials["boundary"] = _pysph_columns(
                wall, np.zeros((m, 2)), np.full(m, 1000.0), np.zeros(m)
            )
        path = folder / f"flow_{every * k}{suffix}"
        solver = {"dt": 1e-3, "t": float(t), "count": every * k}
        if suffix == ".npz":
            particles = {
                name: {"arrays": columns, "constants": {}, "properties": {}}
                for name, columns in materials.items()
            }
            np.savez(path, version=2, particles=particles, solver_data=solver)
        else:
            _write_pysph_hdf5(path, materials, solver)


def _pysph_columns(x, v, rho, p):
    n = len(x)
    columns = {"x": x[:, 0], "y": x[:, 1], "z": np.zeros(n), "u": v[:, 0], "v": v[:, 1]}
    gid = np.full(n, 2**32 - 1, np.uint32)
    return columns | {"w": np.zeros(n), "rho": rho, "p": p, "gid": gid, "h": np.full(n, 0.1)}


def _write_pysph_hdf5(path, materials, solver):
    import h5py

    with h5py.File(path, "w") as file:
        group = file.create_group("solver_data")
        group.attrs.update(solver)
        for name, columns in materials.items():
            arrays = file.create_group(f"particles/{name}/arrays")
            file.create_group(f"particles/{name}/constants")
            for key, column in columns.items():
                arrays.create_dataset(key, data=column)
            arrays.create_dataset("au", (0,), dtype=np.float64)


def write_vtu(path: Path, columns, points):
    """Write a .vtu with compressed binary data, as VTK's own writer does."""
    import base64

    def data(values, kind, more=""):
        names = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}
        raw = np.ascontiguousarray(values, dtype=kind).tobytes()
        packed = zlib.compress(raw)
        head = struct.pack("<4I", 1, len(raw), len(raw), len(packed))
        text = (base64.b64encode(head) + base64.b64encode(packed)).decode()
        return f'<DataArray type="{names[kind]}" {more} format="binary">{text}</DataArray>'

    def named(name, values):
        d = f'Name="{name}"' + (' NumberOfComponents="3"' if values.ndim == 2 else "")
        return data(values, "f8", d)

    n = len(points)
    path.write_text(
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" '
        'compressor="vtkZLibDataCompressor"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{n}" NumberOfCells="{n}"><Points>'
        + data(points, "f8", 'NumberOfComponents="3"')
        + "</Points><Cells>"
        + data(np.arange(n), "i8", 'Name="connectivity"')
        + data(np.arange(1, n + 1), "i8", 'Name="offsets"')
        + data(np.ones(n), "u1", 'Name="types"')
        + "</Cells><PointData>"
        + "".join(named(name, np.asarray(values)) for name, values in columns.items())
        + "</PointData></Piece></UnstructuredGrid></VTKFile>"
    )
