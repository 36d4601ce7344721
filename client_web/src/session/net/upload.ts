/** Multipart uploads with progress, which fetch cannot report. */
import type { DroppedFile } from "../../start/files/dropTypes";
import type {
  BtfJobBody,
  EnvironmentBody,
  IesBody,
  ImageBody,
  ImportedBody,
  ImportOptions,
  LutBody,
  MeasuredBody,
  SceneBody,
} from "../../protocol";
import { ApiError } from "./api";
import { serverUrl } from "./serverUrl";

export interface SceneUpload {
  scene: DroppedFile;
  /** The files that the scene refers to. */
  companions: readonly DroppedFile[];
  environment: File | null;
  name: string;
  ground: boolean;
  options: ImportOptions;
}

function parseResponse(request: XMLHttpRequest): unknown {
  const body = JSON.parse(request.responseText || "null") as unknown;
  if (request.status === 201 || request.status === 202) return body;
  const { detail, title } = (body ?? {}) as { detail?: unknown; title?: string };
  throw new ApiError(
    typeof detail === "string" ? detail : (title ?? `Server error ${request.status}.`),
    request.status,
  );
}

/** Upload a form; `progress` receives the sent fraction, 0…1. Throws ApiError with the server's message. */
function postForm(path: string, form: FormData, progress: (fraction: number) => void): Promise<unknown> {
  return new Promise<XMLHttpRequest>((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.upload.onprogress = (event) => progress(event.total > 0 ? event.loaded / event.total : 0);
    request.onload = () => resolve(request);
    request.onerror = () => reject(new ApiError("Upload interrupted. Nothing was imported; try again.", 0));
    request.open("POST", serverUrl(path));
    request.send(form);
  }).then(parseResponse);
}

export function uploadScene(upload: SceneUpload, progress: (fraction: number) => void): Promise<SceneBody> {
  const form = new FormData();
  form.append("scene", upload.scene.file, upload.scene.path);
  for (const { file, path } of upload.companions) form.append("companions", file, path);
  if (upload.environment !== null) form.append("environment", upload.environment);
  form.append("name", upload.name);
  form.append("ground", String(upload.ground));
  for (const [option, value] of Object.entries({ ...upload.options }))
    if (value !== null) form.append(option, String(value));
  return postForm("/api/scenes", form, progress) as Promise<SceneBody>;
}

/** Upload an environment, named after its file. */
export function uploadEnvironment(file: File, progress: (fraction: number) => void): Promise<EnvironmentBody> {
  const form = new FormData();
  form.append("environment", file);
  return postForm("/api/environments", form, progress) as Promise<EnvironmentBody>;
}

/** Upload an IES file, named after it. */
export function uploadIes(file: File, progress: (fraction: number) => void): Promise<IesBody> {
  const form = new FormData();
  form.append("ies", file);
  return postForm("/api/ies", form, progress) as Promise<IesBody>;
}

/** Upload a texture image, named after its file. */
export function uploadImage(file: File, progress: (fraction: number) => void): Promise<ImageBody> {
  const form = new FormData();
  form.append("image", file);
  return postForm("/api/images", form, progress) as Promise<ImageBody>;
}

/** Upload a display LUT, named after its file. */
export function uploadLut(file: File, progress: (fraction: number) => void): Promise<LutBody> {
  const form = new FormData();
  form.append("lut", file);
  return postForm("/api/luts", form, progress) as Promise<LutBody>;
}

/** Upload a measured BRDF; the library lists it under its file name. */
export function uploadMeasured(file: File, progress: (fraction: number) => void): Promise<MeasuredBody> {
  const form = new FormData();
  form.append("material", file);
  return postForm("/api/materials/measured", form, progress) as Promise<MeasuredBody>;
}

/** Upload a MaterialX document, or a ZIP with one and its images. */
export function uploadMaterials(file: File, progress: (fraction: number) => void): Promise<ImportedBody> {
  const form = new FormData();
  form.append("material", file);
  return postForm("/api/materials/imported", form, progress) as Promise<ImportedBody>;
}

/** Upload a mesh of one repeat to render a BTF from; `period`: its width in meters if not the bounding box's. */
export function uploadGeometry(
  file: File,
  period: number | null,
  progress: (fraction: number) => void,
): Promise<BtfJobBody> {
  const form = new FormData();
  form.append("geometry", file);
  if (period !== null) form.append("period", String(period));
  return postForm("/api/materials/btf/jobs/geometry", form, progress) as Promise<BtfJobBody>;
}

/** Upload a BTF, as a ZIP of images or a .btf file; the server then compresses it. */
export function uploadBtf(file: File, progress: (fraction: number) => void): Promise<BtfJobBody> {
  const form = new FormData();
  form.append("images", file);
  return postForm("/api/materials/btf/jobs", form, progress) as Promise<BtfJobBody>;
}
