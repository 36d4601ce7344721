/** Jobs that import or generate BTFs, and their progress. */
import { useRef } from "preact/hooks";
import type { BtfJobBody } from "../../protocol";
import {
  BTFS,
  resumeJob,
  importMaterial,
  generateBtf,
  makeBtfOfMesh,
  model,
  materialUploadProgress,
} from "./libraryItems";
import { deleteJob, GEOMETRIES, isRunning, isBeingMade, btfJobs, jobText, btfUploadProgress, stopJob } from "./btfJobs";

export const MATERIAL_FILES = ".binary,.bsdf,.brdf,.zip,.btf,.mtlx";
const MESH_FILES = ".glb,.obj,.ply,.zip";

function BtfJob({ work }: { work: BtfJobBody }) {
  const { id, name, progress, state } = work;
  return (
    <li class={`library-job ${state === "failed" ? "has-failed" : ""}`}>
      <span class="library-job-name">{name}</span>
      {isRunning(work) && <progress max={1} value={progress} aria-label={`Progress of ${name}`} />}
      <span role="status">{jobText(work)}</span>
      {isRunning(work) ? (
        <button onClick={() => void stopJob(id)}>Stop</button>
      ) : (
        <span class="group" role="group" aria-label={name}>
          {state === "canceled" && <button onClick={() => void resumeJob(id)}>Resume</button>}
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
  const label = fraction !== null && fraction < 1 ? `Uploading, ${Math.round(100 * fraction)} %` : "Factorizing…";
  return (
    <div class="library-import">
      <input ref={picker} type="file" accept={MATERIAL_FILES} aria-label="Material file" hidden onChange={onImport} />
      <button disabled={fraction !== null} onClick={() => picker.current?.click()}>
        Import material…
      </button>
      {fraction !== null && <span role="status">{label}</span>}
    </div>
  );
}

/** Uploads a mesh of one period, viewed from above, to render a BTF from. */
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
      <input ref={picker} type="file" accept={MESH_FILES} aria-label="Mesh of one repeat" hidden onChange={onImport} />
      <button
        disabled={btfUploadProgress.value !== null}
        title="A mesh of one repeat, viewed from above (+Y): GLB, OBJ, PLY, or a ZIP with its materials"
        onClick={() => picker.current?.click()}
      >
        From mesh…
      </button>
      <label title="Width of one repeat; empty: the width of the mesh">
        Repeat
        <input
          ref={period}
          type="number"
          min={0}
          step="any"
          aria-label="Repeat of the mesh, meters"
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
    <div class="library-synthetic" role="group" aria-label="Render a BTF">
      <span>Render a BTF (takes minutes):</span>
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
        <ul class="library-jobs" aria-label="BTF jobs">
          {btfJobs.value.map((work) => (
            <BtfJob key={work.id} work={work} />
          ))}
        </ul>
      )}
    </>
  );
}
