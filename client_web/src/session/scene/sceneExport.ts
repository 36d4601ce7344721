/** Export of a scene with a look: the report before, and the file. */
import type { ExportReportBody, ExportRequest } from "../../protocol";
import { json, request } from "../net/api";

export type ExportFormat = ExportRequest["format"];

export const EXPORT_FORMATS: readonly { value: NonNullable<ExportFormat>; label: string; title: string }[] = [
  { value: "glb", label: "GLB", title: "glTF with lights, cameras and variants" },
  { value: "usd", label: "USD", title: "Package with lights, cameras, environment and variants" },
  { value: "materialx", label: "MaterialX", title: "OpenPBR materials and their images, without geometry" },
  { value: "light_mix", label: "Light mix", title: "Intensities and colors of lights by name, as JSON" },
];

const path = (scene: string) => `/api/scenes/${encodeURIComponent(scene)}/exports`;

export async function exportReport(scene: string, body: ExportRequest): Promise<ExportReportBody> {
  return (await (await request(`${path(scene)}/report`, json("POST", body))).json()) as ExportReportBody;
}

/** The file, and its name from the server. */
export async function exportFile(scene: string, body: ExportRequest): Promise<{ blob: Blob; name: string }> {
  const response = await request(path(scene), json("POST", body));
  return { blob: await response.blob(), name: fileName(response.headers.get("content-disposition") ?? "") };
}

/** The file name in a Content-Disposition header. */
export function fileName(disposition: string): string {
  const encoded = /filename\*=utf-8''([^;]+)/i.exec(disposition)?.[1];
  return encoded === undefined ? (/filename="([^"]*)"/.exec(disposition)?.[1] ?? "scene") : decodeURIComponent(encoded);
}

/** A sentence for each difference between the look and the file, fits first, the largest error first. */
export function reportLines({ materials, omitted }: ExportReportBody): string[] {
  const fitted = materials.filter(({ exact }) => !exact).sort((a, b) => b.error - a.error);
  const fits = fitted.map(({ name, look, error }) => {
    const variant = look === null ? "" : ` in “${look}”`;
    return `${name}${variant}: fitted, error ${Math.round(100 * error)} %`;
  });
  return [...fits, ...materials.flatMap((material) => material.omitted), ...omitted];
}
