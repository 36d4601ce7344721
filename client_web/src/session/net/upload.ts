/** Imports: multipart uploads with progress, which fetch cannot report. */
import type { DroppedFile } from "../../start/files/dropTypes";
import type { BtfJobBody, EnvironmentBody, ImageBody, MeasuredBody, SceneBody } from "../../protocol";
import { ApiError } from "./api";

export interface SceneUpload {
  scene: DroppedFile;
  /** The files that it names. */
  companions: readonly DroppedFile[];
  environment: File | null;
  name: string;
  ground: boolean;
}

function parseResponse(request: XMLHttpRequest): unknown {
  const body = JSON.parse(request.responseText || "null") as unknown;
  if (request.status === 201 || request.status === 202) return body;
  const { detail, title } = (body ?? {}) as { detail?: unknown; title?: string };
  throw new ApiError(
    typeof detail === "string" ? detail : (title ?? `The server answered ${request.status}.`),
    request.status,
  );
}

/** `progress` gets 0…1 of the bytes sent; raises ApiError with the server's message. */
function postForm(path: string, form: FormData, progress: (fraction: number) => void): Promise<unknown> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.upload.onprogress = (event) => progress(event.total > 0 ? event.loaded / event.total : 0);
    request.onload = () => {
      try {
        resolve(parseResponse(request));
      } catch (error) {
        reject(error as Error);
      }
    };
    request.onerror = () => reject(new ApiError("The upload was interrupted; nothing was imported. Try again.", 0));
    request.open("POST", path);
    request.send(form);
  });
}

export function uploadScene(upload: SceneUpload, progress: (fraction: number) => void): Promise<SceneBody> {
  const form = new FormData();
  form.append("scene", upload.scene.file, upload.scene.path);
  for (const { file, path } of upload.companions) form.append("companions", file, path);
  if (upload.environment !== null) form.append("environment", upload.environment);
  form.append("name", upload.name);
  form.append("ground", String(upload.ground));
  return postForm("/api/scenes", form, progress) as Promise<SceneBody>;
}

/** An environment that looks may name; it is called as its file is. */
export function uploadEnvironment(file: File, progress: (fraction: number) => void): Promise<EnvironmentBody> {
  const form = new FormData();
  form.append("environment", file);
  return postForm("/api/environments", form, progress) as Promise<EnvironmentBody>;
}

/** An image that terms of looks may name; it is called as its file is. */
export function uploadImage(file: File, progress: (fraction: number) => void): Promise<ImageBody> {
  const form = new FormData();
  form.append("image", file);
  return postForm("/api/images", form, progress) as Promise<ImageBody>;
}

/** A MERL file; what it is called in the library is its file's name. */
export function uploadMeasured(file: File, progress: (fraction: number) => void): Promise<MeasuredBody> {
  const form = new FormData();
  form.append("material", file);
  return postForm("/api/materials/measured", form, progress) as Promise<MeasuredBody>;
}

/** A mesh of one period, to be rendered; `period`: its side in meters, where it is not that of the box about it. */
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

/** A zip of images of a texture from all sides, or a .btf container; the server compresses them from then on. */
export function uploadBtf(file: File, progress: (fraction: number) => void): Promise<BtfJobBody> {
  const form = new FormData();
  form.append("images", file);
  return postForm("/api/materials/btf/jobs", form, progress) as Promise<BtfJobBody>;
}
