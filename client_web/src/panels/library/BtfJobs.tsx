/** Jobs that import or generate BTFs, and their progress. */
import { useRef } from "preact/hooks";
import type { BtfJobBody } from "../../protocol";
import { BTFS, resumeJob, importMaterial, generateBtf, makeBtfOfMesh, model, materialUploadProgress } from "./libraryItems";
import { deleteJob, GEOMETRIES, isRunning, isBeingMade, btfJobs, jobText, btfUploadProgress, stopJob } from "./btfJobs";

export const MATERIAL_FILES = ".binary,.zip,.btf";
const MESH_FILES = ".glb,.obj,.ply,.zip";

function BtfJob({ work }: { work: BtfJobBody }) {
  const { id, name, progress, state } = work;
  return (
    <li class={`library-making ${state === "failed" ? "has-failed" : ""}`}>
      <span class="library-making-name">{name}</span>
      {isRunning(work) && <progress max={1} value={progress} aria-label={`Making of ${name}`} />}
      <span role="status">{jobText(work)}</span>
      {isRunning(work) ? (
        <button onClick={() => void stopJob(id)}>Stop</button>
      ) : (
        <span class="group" role="group" aria-label={name}>
          {state === "stopped" && <button onClick={() => void resumeJob(id)}>Go on</button>}
          <button onClick={() => void deleteJob(id)}>Remove</button>
        </span>
      )}
    </li>
  );
}

function ImageImport() {
  const picker = useRef<HTMLInputElement>(null);
  const onImport = (event: Event) => {
    const input = event.currentTarget as HTMLInputElement;
    const file = input.files?.[0];
    input.value = "";
    if (file !== undefined) void importMaterial(file);
  };
  const fraction = materialUploadProgress.value ?? btfUploadProgress.value;
  const label = fraction !== null && fraction < 1 ? `Sending, ${Math.round(100 * fraction)} %` : "Factorising…";
  return (
    <div class="library-import">
      <input ref={picker} type="file" accept={MATERIAL_FILES} aria-label="Measured material" hidden onChange={onImport} />
      <button disabled={fraction !== null} onClick={() => picker.current?.click()}>
        Import a measured material…
      </button>
      {fraction !== null && <span role="status">{label}</span>}
    </div>
  );
}

/** A user's mesh that holds one period, viewed from above. */
function MeshImport() {
  const picker = useRef<HTMLInputElement>(null);
  const period = useRef<HTMLInputElement>(null);
  const onImport = (event: Event) => {
    const input = event.currentTarget as HTMLInputElement;
    const file = input.files?.[0];
    input.value = "";
    const side = period.current?.valueAsNumber ?? NaN;
    if (file !== undefined) void makeBtfOfMesh(file, Number.isNaN(side) ? null : side);
  };
  return (
    <div class="library-mesh">
      <input ref={picker} type="file" accept={MESH_FILES} aria-label="Mesh of one period" hidden onChange={onImport} />
      <button
        disabled={btfUploadProgress.value !== null}
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

/** The form that generates a BTF from parameters. */
function GeneratedBtf() {
  if (model.value !== BTFS) return null;
  return (
    <div class="library-synthetic" role="group" aria-label="Make a synthetic texture">
      <span>Render a synthetic one, some minutes:</span>
      {GEOMETRIES.map((geometry) => (
        <button key={geometry} disabled={isBeingMade(geometry)} onClick={() => void generateBtf(geometry)}>
          {geometry}
        </button>
      ))}
      <MeshImport />
    </div>
  );
}

export function BtfJobs() {
  return (
    <>
      <ImageImport />
      <GeneratedBtf />
      {btfJobs.value.length > 0 && (
        <ul class="library-makings" aria-label="In the making">
          {btfJobs.value.map((work) => (
            <BtfJob key={work.id} work={work} />
          ))}
        </ul>
      )}
    </>
  );
}
