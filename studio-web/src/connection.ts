/** The way to the server: the token of the address becomes a cookie, then messages go over one WebSocket that comes back by itself. */
import { type Frame, unpack } from "./frames";
import type { FromPage, FromServer } from "./messages";

export interface Listener {
  message(message: FromServer): void;
  frame(frame: Frame): void;
  online(yes: boolean, why: string): void;
}

const GONE = "The studio is not running. Nothing is lost: start it again with “scan2nurbs studio” and the scan or project, and open the address that it prints.";

export class Connection {
  private socket: WebSocket | null = null;
  private wait = 500;
  private opened = false;

  constructor(private readonly listener: Listener) {}

  async open(): Promise<void> {
    const token = new URLSearchParams(location.hash.slice(1)).get("token");
    if (token) {
      const answer = await fetch("session", { method: "POST", body: token }).catch(() => null);
      if (!answer?.ok) return this.listener.online(false, answer ? await answer.text() : GONE);
      history.replaceState(null, "", location.pathname);
    }
    this.connect();
  }

  send(message: FromPage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
    else this.listener.online(false, GONE);
  }

  private connect(): void {
    const socket = new WebSocket(`ws://${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.opened = true;
      this.wait = 500;
      this.listener.online(true, "");
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (typeof event.data === "string") this.listener.message(JSON.parse(event.data) as FromServer);
      else this.listener.frame(unpack(event.data));
    };
    socket.onclose = () => {
      this.listener.online(false, this.opened ? GONE : "Open the studio with the whole address that it printed, the part behind # included.");
      setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(this.wait * 1.5, 5000);
    };
    this.socket = socket;
  }
}
