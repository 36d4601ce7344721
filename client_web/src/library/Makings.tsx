/** Import of measurements, making of synthetic textures from all sides, and how far both are. */
import { useRef } from "preact/hooks";
import type { BtfWorkBody } from "../protocol";
import { BTFS, goOn, importMaterial, make, makeOf, model, sending } from "./library";
import { forgetMaking, GEOMETRIES, isGoingOn, isInTheMaking, makings, makingWords, sendingImages, stopMaking } from "./making";

export const MATERIAL_FILES = ".binary,.zip,.btf";
const MESH_FILES = ".glb,.obj,.ply,.zip";

function Making({ work }: { work: BtfWorkBody }) {
  const { id, name, progress, state } = work;
  return (
    <li class={`library-making ${state === "failed" ? "has-failed" : ""}`}>
      <span class="library-making-name">{name}</span>
      {isGoingOn(work) && <progress max={1} value={progress} aria-label={`Making of ${name}`} />}
      <span role="status">{makingWords(work)}</span>
      {isGoingOn(work) ? (
        <button onClick={() => void stopMaking(id)}>Stop</button>
      ) : (
        <span class="group" role="group" aria-label={name}>
          {state === "stopped" && <button onClick={() => void goOn(id)}>Go on</button>}
          <button onClick={() => void forgetMaking(id)}>Remove</button>
        </span>
      )}
    </li>
  );
}

function Import() {
  const picker = useRef<HTMLInputElement>(null);
  const take = (event: Event) => {
    const input = event.currentTarget as HTMLInputElement;
    const file = input.files?.[0];
    input.value = "";
    if (file !== undefined) void importMaterial(file);
  };
  const share = sending.value ?? sendingImages.value;
  const words = share !== null && share < 1 ? `Sending, ${Math.round(100 * share)} %` : "Factorising…";
  return (
    <div class="library-import">
      <input ref={picker} type="file" accept={MATERIAL_FILES} aria-label="Measured material" hidden onChange={take} />
      <button disabled={share !== null} onClick={() => picker.current?.click()}>
        Import a measured material…
      </button>
      {share !== null && <span role="status">{words}</span>}
    </div>
  );
}

/** A mesh of one's own that holds one period, seen from above. */
function OfMesh() {
  const picker = useRef<HTMLInputElement>(null);
  const period = useRef<HTMLInputElement>(null);
  const take = (event: Event) => {
    const input = event.currentTarget as HTMLInputElement;
    const file = input.files?.[0];
    input.value = "";
    const side = period.current?.valueAsNumber ?? NaN;
    if (file !== undefined) void makeOf(file, Number.isNaN(side) ? null : side);
  };
  return (
    <div class="library-mesh">
      <input ref={picker} type="file" accept={MESH_FILES} aria-label="Mesh of one period" hidden onChange={take} />
      <button
        disabled={sendingImages.value !== null}
        title="A mesh that holds one period, seen from above (+Y): .glb, .obj, .ply, or a .zip with its materials"
        onClick={() => picker.current?.click()}
      >
        a mesh of yours…
      </button>
      <label title="Side of the square that repeats; empty: the mesh is as wide as it">
        period
        <input
          ref={period}
          type="number"
          min={0}
          step="any"
          aria-label="Period of the mesh, metres"
          onKeyDown={(event) => event.stopPropagation()}
        />
        m
      </label>
    </div>
  );
}

/** Where textures from all sides are shown: synthetic ones are made here, too. */
function Synthetic() {
  if (model.value !== BTFS) return null;
  return (
    <div class="library-synthetic" role="group" aria-label="Make a synthetic texture">
      <span>Render a synthetic one, some minutes:</span>
      {GEOMETRIES.map((geometry) => (
        <button key={geometry} disabled={isInTheMaking(geometry)} onClick={() => void make(geometry)}>
          {geometry}
        </button>
      ))}
      <OfMesh />
    </div>
  );
}

export function Makings() {
  return (
    <>
      <Import />
      <Synthetic />
      {makings.value.length > 0 && (
        <ul class="library-makings" aria-label="In the making">
          {makings.value.map((work) => (
            <Making key={work.id} work={work} />
          ))}
        </ul>
      )}
    </>
  );
}
