/** Loads images of a moving camera: one request at a time, then one for the newest pose. */
import type { BakeSize } from "../../session/scene/recipe";
import type { CameraPose } from "./orbit";

interface ImageRequest {
  frame: CameraPose;
  size: BakeSize;
}

export class PlacementImages {
  private next: ImageRequest | null = null;
  private isBusy = false;
  private isClosed = false;

  constructor(
    private readonly request: (frame: CameraPose, size: BakeSize) => Promise<Blob>,
    private readonly draw: (blob: Blob) => Promise<void>,
    private readonly fail: (error: unknown) => void,
  ) {}

  show(frame: CameraPose, size: BakeSize): void {
    this.next = { frame, size };
    if (!this.isBusy) void this.run();
  }

  close(): void {
    this.isClosed = true;
    this.next = null;
  }

  private async run(): Promise<void> {
    this.isBusy = true;
    while (this.next !== null) {
      const { frame, size } = this.next;
      this.next = null;
      try {
        const blob = await this.request(frame, size);
        if (!this.isClosed) await this.draw(blob);
      } catch (error) {
        if (!this.isClosed) this.fail(error);
      }
    }
    this.isBusy = false;
  }
}
