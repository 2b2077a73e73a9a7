/*
 * client.c HOST PORT -- a client made by rpcgen from sorma.x, with nothing of SORMA in it: calls echo and foo.
 */
#include "sorma.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char **argv) {
    struct sockaddr_in address;
    int socket = RPC_ANYSOCK, i;
    CLIENT *client;
    double floats[2] = {1.5, -2};
    sorma_call call;
    sorma_reply *reply;

    if (argc != 3) return fprintf(stderr, "usage: client HOST PORT\n"), 2;
    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    address.sin_port = htons(atoi(argv[2]));
    inet_pton(AF_INET, argv[1], &address.sin_addr);
    client = clnttcp_create(&address, SORMA_PROGRAM, SORMA_V1, &socket, 0, 0);
    if (!client) return clnt_pcreateerror(argv[1]), 1;

    memset(&call, 0, sizeof call);
    call.slot = SORMA_NO_SLOT;
    call.method = SORMA_EXEC;
    call.name = "echo";
    call.request.text = "from rpcgen";
    call.request.floats.floats_len = 2;
    call.request.floats.floats_val = floats;
    reply = sorma_call_1(&call, client);
    if (!reply) return clnt_perror(client, "echo"), 1;
    printf("code %d text %s floats", reply->code, reply->result.text);
    for (i = 0; i < (int)reply->result.floats.floats_len; i++) printf(" %g", reply->result.floats.floats_val[i]);
    printf("\n");

    call.name = "foo";
    call.method = SORMA_CTRL;
    call.request.text = "";
    call.request.floats.floats_len = 0;
    {
        sorma_string words[] = {"-tempo", "backwards"};
        call.request.words.words_len = 2;
        call.request.words.words_val = words;
        reply = sorma_call_1(&call, client);
    }
    if (!reply) return clnt_perror(client, "foo"), 1;
    printf("code %d", reply->code);
    for (i = 0; i < (int)reply->trail.entries.entries_len; i++)
        printf(" %s: %s", reply->trail.entries.entries_val[i].symbol, reply->trail.entries.entries_val[i].text);
    printf("\n");
    clnt_destroy(client);
    return 0;
}
